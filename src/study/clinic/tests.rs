//! Frames of a study are those that the device's ports give.

use super::{Pod, binned};
use crate::faults::{Desk, DeskCamera, DeskPort, Link};
use phasmid_device::port::Port;
use phasmid_host::{Captured, Intake, ScanOptions, Scanner};
use phasmid_profile::{Configuration, Profile, Scene};
use phasmid_protocol::faults::Schedule;
use phasmid_render::Renderer;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// By its port and its camera, as any client does.
fn scanned(profile: &Profile, scene: &Scene, seed: u64) -> Captured {
    let renderer = Renderer::new(profile, scene, seed).unwrap();
    let schedule = Schedule::default();
    let desk = Desk::new(
        profile,
        renderer,
        Port::default(),
        Link::Identified,
        &schedule,
    );
    let desk = Rc::new(RefCell::new(desk.unwrap()));
    let open = || Ok(Intake::new(DeskCamera::open(&desk)));
    let wait = Duration::from_secs(2);
    let mut scanner = Scanner::with_dialect(DeskPort::open(&desk), None, wait, open).unwrap();
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
        let in_memory = pod.scan(begin_ns, None).captured();
        assert_eq!(in_memory.manifest.frame, by_ports.manifest.frame);
        assert_eq!(in_memory.calibration, by_ports.calibration);
        assert_eq!(in_memory.frames.len(), by_ports.frames.len());
        for (i, (one, other)) in in_memory.frames.iter().zip(&by_ports.frames).enumerate() {
            assert_eq!(one.data, other.data, "{}, frame {i}", device.name);
        }
    }
}
