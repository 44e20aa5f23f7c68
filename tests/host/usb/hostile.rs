//! Runs the USB fuzz targets over fixed cases, the same in every run.

use crate::cases::each;
use crate::usb::fuzz::{device, host};
use std::time::Duration;

#[test]
fn hostile_host_gets_valid_replies_or_is_disconnected() {
    let seeds = device::seeds();
    for seed in &seeds {
        device::run(seed);
    }
    each(4000, &seeds, device::run);
}

#[test]
fn host_gives_up_in_time_on_a_hostile_server() {
    each(150, &host::seeds(), |script| {
        host::run(script);
    });
}

/// Scripts without damage reach the end; otherwise the cases above would test little.
#[test]
fn well_behaved_server_gives_frames_and_an_echo() {
    for script in [&[][..], &[1], &[0, 1], &[1, 1]] {
        let reached = host::run_within(script, Duration::from_secs(60));
        assert!(reached.opened && reached.echoed, "{reached:?}");
        assert_eq!(reached.frames, 6);
    }
}
