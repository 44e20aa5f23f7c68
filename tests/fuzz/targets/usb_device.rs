#![no_main]

libfuzzer_sys::fuzz_target!(|script: &[u8]| {
    phasma_fuzz::usb::device::run(script);
});
