//! Whatever the first bytes say it is, most often within gzip or Zstandard.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| spao_server_fuzz::check_detected(bytes));
