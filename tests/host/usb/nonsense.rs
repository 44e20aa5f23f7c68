//! Clients that send nonsense disturb no other client.

use crate::usb::served::{Served, TIMEOUT, frame};
use phasmid::host::Camera;
use phasmid::host::usb::UsbCamera;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::PixelFormat;
use phasmid::protocol::usb::usbip::{Operation, bus_id_bytes};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::cell::RefCell;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Sends bytes, and reads until the server disconnects or is silent for a while.
fn talk(host: &str, bytes: &[u8]) {
    let mut stream = TcpStream::connect(host).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_millis(3)))
        .unwrap();
    // The server may disconnect before the end.
    let _ = stream.write_all(bytes);
    let _ = stream.read_to_end(&mut Vec::new());
}

#[test]
fn stream_continues_beside_invalid_connections() {
    let served = Served::several(2, Speed::High, Transfer::Bulk);
    let device = served.open();
    let camera = RefCell::new((UsbCamera::open(&device, None).unwrap(), 0));
    let import = [&Operation::Import.encode()[..], &bus_id_bytes("1-2")].concat();
    let word = prop_oneof![
        Just(0u32),
        Just(1),
        Just(2),
        Just(u32::MAX),
        0..4096u32,
        any::<u32>()
    ];
    let commands = prop::collection::vec(prop::array::uniform12(word), 0..12);
    let strategy = (0..3u8, any::<Vec<u8>>(), commands);
    let mut runner = TestRunner::new(Config {
        cases: 120,
        failure_persistence: None,
        ..Config::default()
    });
    runner
        .run(&strategy, |(kind, noise, commands)| {
            let commands = commands
                .iter()
                .flatten()
                .flat_map(|word| word.to_be_bytes());
            let bytes: Vec<u8> = match kind {
                0 => noise,
                1 => import.iter().copied().chain(noise).collect(),
                // Commands that are almost valid.
                _ => import.iter().copied().chain(commands).collect(),
            };
            talk(&served.host, &bytes);
            let (camera, id) = &mut *camera.borrow_mut();
            let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
            prop_assert!(got.data == frame(*id, PixelFormat::Grey).data);
            *id += 1;
            Ok(())
        })
        .unwrap();
}

#[test]
fn silent_connections_do_not_keep_clients_out() {
    let served = Served::new(Speed::High, Transfer::Bulk);
    // Many more connections than the server keeps open at a time; each may be silent for 10 s.
    let silent: Vec<_> = (0..200)
        .map(|_| TcpStream::connect(&served.host).unwrap())
        .collect();
    let start = Instant::now();
    let device = served.open();
    let mut camera = UsbCamera::open(&device, None).unwrap();
    assert!(camera.next_frame(TIMEOUT).unwrap().is_some());
    assert!(
        start.elapsed() < Duration::from_secs(5),
        "{:?}",
        start.elapsed()
    );
    // The oldest connections have been closed; the newest have not timed out yet.
    let ended = |mut stream: &TcpStream| {
        stream.set_nonblocking(true).unwrap();
        !matches!(stream.read(&mut [0]), Err(e) if e.kind() == ErrorKind::WouldBlock)
    };
    assert!(ended(&silent[0]) && ended(&silent[100]));
    assert!(!ended(&silent[199]));
}
