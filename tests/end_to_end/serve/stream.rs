//! Frames and ground truth over their sockets.

use crate::served::{LONG, Served, serve};
use phasmid::host::{CameraDriver, open_camera};
use phasmid::protocol::service;
use std::fs;
use std::io::{Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::time::Duration;

#[test]
fn same_seed_and_triggers_give_the_same_bytes() {
    let frames = |threads: &str| {
        let served = Served::spawn(serve().env("RAYON_NUM_THREADS", threads));
        let mut instrument = served.instrument();
        instrument.order("TRIG:SOUR BUS").unwrap();
        let mut camera = open_camera(&served.at.camera, CameraDriver::Auto, LONG).unwrap();
        instrument.tell("INIT;*TRG").unwrap();
        (0..13)
            .map(|_| camera.next_frame(LONG).unwrap().unwrap())
            .collect::<Vec<_>>()
    };
    assert!(
        frames("1") == frames("2"),
        "ids, times and pixels are the same"
    );
}

#[test]
fn frames_come_over_tcp_and_run_free() {
    let served = Served::start(&["--tcp", "0"]);
    let mut camera = open_camera(
        served.at.camera_tcp.as_ref().unwrap(),
        CameraDriver::Auto,
        LONG,
    )
    .unwrap();
    let first = camera.next_frame(LONG).unwrap().unwrap();
    let second = camera.next_frame(LONG).unwrap().unwrap();
    assert_eq!(first.pattern_index, None);
    assert!(second.id > first.id && second.exposure_start_ns > first.exposure_end_ns);
    let mut instrument = served.instrument();
    instrument.order("TRIG:SOUR BUS").unwrap();
    assert_eq!(instrument.query("*OPC?").unwrap(), "1");
    while camera
        .next_frame(Duration::from_millis(50))
        .unwrap()
        .is_some()
    {}
    instrument.order("INIT").unwrap();
    assert_eq!(
        camera.next_frame(Duration::from_millis(50)).unwrap(),
        None,
        "armed"
    );
    instrument.tell("*TRG").unwrap();
    for i in 0..13 {
        let frame = camera.next_frame(LONG).unwrap().unwrap();
        assert_eq!(frame.pattern_index, Some(i));
    }
    served.stop(crate::interrupt());
}

#[test]
fn truth_comes_on_a_channel_of_its_own() {
    let served = Served::start(&[]);
    let mut stream = UnixStream::connect(&served.at.service).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    let mode = fs::metadata(&served.at.service)
        .unwrap()
        .permissions()
        .mode();
    assert_eq!(mode & 0o777, 0o600);
    for _ in 0..2 {
        let request = service::Request::Get(service::Item::Truth);
        let maps = service::ask(&mut stream, request).unwrap();
        assert_eq!(
            (maps.width, maps.height, maps.flags.len()),
            (640, 480, 640 * 480)
        );
        assert_eq!(maps.maps[0].0, "depth_mm");
        phasmid::emulator::Truth::from_maps(maps).unwrap();
    }
    // An invalid request gets an error, and the connection stays open.
    stream.write_all(b"{\"get\":\"moon\"}\n").unwrap();
    let mut byte = [0];
    let mut line = Vec::new();
    while stream.read(&mut byte).unwrap() == 1 && byte[0] != b'\n' {
        line.push(byte[0]);
    }
    assert!(service::Reply::parse(&line).unwrap().error.is_some());
    // The external trigger is a signal line, not a command.
    let mut instrument = served.instrument();
    instrument.order("TRIG:SOUR EXT;:INIT").unwrap();
    service::ask(&mut stream, service::Request::Do(service::Action::Trigger)).unwrap();
    assert_eq!(instrument.query("*OPC?;:DIAG:FRAM?").unwrap(), "1;13");
    // The control port is not affected.
    assert!(
        instrument
            .order("DIAG:TRUT?")
            .unwrap_err()
            .to_string()
            .contains("-113")
    );
    served.stop(rustix::process::Signal::TERM);
}
