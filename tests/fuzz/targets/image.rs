#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    phasmid_fuzz::parsers::run("image", bytes);
});
