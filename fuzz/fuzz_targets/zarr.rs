//! Zip and tar archives of Zarr hierarchies.
#![no_main]

use spao_server_fuzz::{Format, check};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check(Format::Zarr, bytes));
