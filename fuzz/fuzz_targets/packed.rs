//! A header with its data in an archive: one that is whole, whatever is in it, and one of any bytes.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    spao_server_fuzz::check_detected(bytes);
    spao_server_fuzz::check_packed(bytes);
});
