//! Tests that a study's frames are identical to the frames that clients get through the device's ports.

use super::{Pod, binned};
use crate::desk::{Desk, Link};
use phasmid_decode::Capture;
use phasmid_device::Device;
use phasmid_host::{Intake, ScanOptions, Scanner};
use phasmid_profile::{Configuration, Profile, Scene};
use std::time::Duration;

/// Scans through the device's port and camera, as any client does.
fn scanned(profile: &Profile, scene: &Scene, seed: u64) -> Capture {
    let device = Device::builder(profile, scene).seed(seed).build().unwrap();
    let desk = Desk::new(device, Link::Identified);
    let open = || Ok(Intake::new(desk.camera()));
    let wait = Duration::from_secs(2);
    let mut scanner = Scanner::with_dialect(desk.port(), None, wait, open).unwrap();
    let options = ScanOptions {
        sequence: None,
        manifest: None,
        frame_timeout: wait,
    };
    scanner.scan(&options, &mut |_| {}).unwrap()
}

#[test]
fn a_pod_gives_the_bytes_that_its_ports_give() {
    let Configuration::Station(station) = Configuration::load("sgrt-ceiling").unwrap() else {
        panic!("a station");
    };
    let scene = Scene::load("treatment-room").unwrap();
    for device in &station.device {
        let mut profile = Profile::load(&station.profile(device)).unwrap();
        binned(&mut profile, [160, 120]);
        // A pod of the studies measures with the exact rig.
        profile.factory_calibration.exact = true;
        let place = device.rig().unwrap();
        let before = Scene {
            rig: place,
            ..scene.clone()
        };
        let by_ports = scanned(&profile, &before, 7);
        let begin_ns = by_ports.frames[0].exposure_start_ns;
        let mut pod = Pod::new(&profile, &scene, place, 7).unwrap();
        let in_memory = pod.scan(begin_ns, None).unwrap();
        assert_eq!(in_memory.manifest.frame, by_ports.manifest.frame);
        assert_eq!(in_memory.calibration, by_ports.calibration);
        assert!(in_memory.images == by_ports.images, "{}", device.name);
    }
}
