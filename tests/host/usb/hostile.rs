//! Runs the USB fuzz targets over fixed cases, the same in every run.

use crate::cases::each;
use crate::usb::fuzz::{device, host};
use std::time::Duration;

#[test]
fn a_hostile_host_gets_sound_replies_or_is_let_go() {
    let seeds = device::seeds();
    for seed in &seeds {
        device::run(seed);
    }
    each(4000, &seeds, device::run);
}

#[test]
fn a_hostile_server_gets_the_host_to_give_up_in_time() {
    each(150, &host::seeds(), |script| {
        host::run(script);
    });
}

/// Scripts without damage reach the end; otherwise the cases above would test little.
#[test]
fn a_server_without_harm_gives_frames_and_an_echo() {
    for script in [&[][..], &[1], &[0, 1], &[1, 1]] {
        let reached = host::run_within(script, Duration::from_secs(60));
        assert!(reached.opened && reached.echoed, "{reached:?}");
        assert_eq!(reached.frames, 6);
    }
}
