#![no_main]

libfuzzer_sys::fuzz_target!(|script: &[u8]| {
    phasmid_fuzz::usb::host::run(script);
});
