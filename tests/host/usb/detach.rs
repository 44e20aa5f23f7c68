//! Transfers unlinked at random, and devices detached at any moment.

use crate::usb::served::{Served, TIMEOUT, frame};
use phasmid::host::usb::{Client, Transfer, UsbAddress, UsbCamera, UsbDevice, UsbPort};
use phasmid::host::{Camera, CommandPort};
use phasmid::link::usb::Event;
use phasmid::profile::{Speed, Transfer as Way};
use phasmid::protocol::PixelFormat;
use phasmid::protocol::usb::usbip::status;
use phasmid::protocol::usb::{Setup, request};
use std::sync::Arc;
use std::time::Duration;

/// A small random number generator, started with a seed.
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, limit: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) % limit
    }
}

#[test]
fn a_device_that_is_given_back_is_free_at_once() {
    let served = Served::new(Speed::High, Way::Bulk);
    let address = UsbAddress::parse(&format!("usb:{}", served.host), "test").unwrap();
    for _ in 0..100 {
        let device = Arc::new(UsbDevice::open(&address, TIMEOUT).unwrap());
        let mut camera = UsbCamera::open(&device, None).unwrap();
        camera.next_frame(TIMEOUT).unwrap().expect("a frame");
    }
}

#[test]
fn transfers_taken_back_at_random_end_once_each() {
    for seed in 0..4 {
        let served = Served::new(Speed::High, Way::Bulk);
        let device = served.open();
        // Negotiates a stream and ends it; the format stays committed.
        drop(UsbCamera::open(&device, None).unwrap());
        let client = device.client();
        let mut random = Random(seed);
        let mut transfers: Vec<Transfer> = Vec::new();
        let mut ends = [0u32; 2];
        for _ in 0..600 {
            match random.below(3) {
                0 => {
                    let endpoint = [0x81, 0x83][random.below(2) as usize];
                    transfers.push(client.submit(endpoint, 16_384, &[]).unwrap());
                }
                1 => {
                    client
                        .submit(0x03, 0, b"echo")
                        .unwrap()
                        .wait(TIMEOUT)
                        .unwrap()
                        .expect("sent");
                }
                _ if !transfers.is_empty() => {
                    let at = random.below(transfers.len() as u64) as usize;
                    let transfer = transfers.swap_remove(at);
                    transfer.unlink().unwrap();
                    let end = transfer.wait(TIMEOUT).unwrap().expect("an end");
                    assert!(
                        matches!(end.status, status::OK | status::UNLINKED),
                        "{end:?}"
                    );
                    assert_eq!(end.data.len(), end.actual);
                    ends[usize::from(end.status == status::OK)] += 1;
                }
                _ => {}
            }
        }
        assert!(ends[0] > 0 && ends[1] > 0, "{ends:?} with seed {seed}");
        drop(transfers);
        // The remainder of a frame must not appear in the next stream.
        device.clear_halt(0x81).unwrap();
        // The device is unchanged.
        let mut camera = UsbCamera::open(&device, None).unwrap();
        for _ in 0..3 {
            camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        }
        let mut port = UsbPort::open(&device).unwrap();
        port.send(b"alive\n", TIMEOUT).unwrap();
        let mut last = Vec::new();
        while !last.ends_with(b"ALIVE\n") {
            let mut buffer = [0; 4096];
            let got = port.receive(&mut buffer, TIMEOUT).unwrap();
            assert!(got > 0);
            last.extend(&buffer[..got]);
        }
    }
}

#[test]
fn device_released_at_any_moment_can_be_opened_again() {
    let served = Served::new(Speed::Super, Way::Bulk);
    let mut random = Random(7);
    for _ in 0..25 {
        let device = served.open();
        let mut camera = UsbCamera::open(&device, None).unwrap();
        let mut port = UsbPort::open(&device).unwrap();
        for _ in 0..random.below(20) {
            camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        }
        port.send(b"half a comma", TIMEOUT).unwrap();
        std::thread::sleep(Duration::from_micros(random.below(3000)));
        match random.below(3) {
            0 => drop(device),
            1 => drop((port, device)),
            // Unplugging disconnects both camera and port.
            _ => {
                served.device().unplug(true);
                let gone = loop {
                    match camera.next_frame(TIMEOUT) {
                        Ok(frame) => drop(frame.expect("a frame or an end")),
                        Err(error) => break error.to_string(),
                    }
                };
                assert!(gone.contains("disconnected"), "{gone}");
                let mut buffer = [0; 4096];
                while port.receive(&mut buffer, TIMEOUT).is_ok_and(|len| len > 0) {}
                assert!(port.receive(&mut buffer, TIMEOUT).is_err());
                assert!(port.send(b"x", TIMEOUT).is_err());
                served.device().unplug(false);
            }
        }
    }
    let mut camera = UsbCamera::open(&served.open(), None).unwrap();
    let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
    assert!(got.data == frame(0, PixelFormat::Grey).data);
}

#[test]
fn connections_cut_in_the_middle_of_a_command_free_the_device() {
    let served = Served::new(Speed::High, Way::Bulk);
    for _ in 0..20 {
        let client = loop {
            match Client::import(&served.host, None, TIMEOUT) {
                Ok(client) => break client,
                Err(e) => assert!(e.to_string().contains("refuses"), "{e}"),
            }
        };
        let reads: Vec<_> = (0..10)
            .map(|_| client.submit(0x83, 512, &[]).unwrap())
            .collect();
        drop(client);
        for read in reads {
            assert!(read.wait(TIMEOUT).is_err());
        }
        served.wait(|event| *event == Event::Detached);
    }
}

#[test]
fn a_device_has_one_host_at_a_time() {
    let served = Served::several(2, Speed::High, Way::Bulk);
    let both = Client::list(&served.host, TIMEOUT).unwrap();
    assert_eq!(
        both.iter().map(|d| d.bus_id.as_str()).collect::<Vec<_>>(),
        ["1-1", "1-2"]
    );
    let error = Client::import(&served.host, None, TIMEOUT).err().unwrap();
    assert_eq!(error.exit_code(), 2);
    let first = Client::import(&served.host, Some("1-1"), TIMEOUT).unwrap();
    let taken = Client::import(&served.host, Some("1-1"), TIMEOUT)
        .err()
        .unwrap();
    assert!(taken.to_string().contains("another host"), "{taken}");
    Client::import(&served.host, Some("1-2"), TIMEOUT).unwrap();
    let unknown = Client::import(&served.host, Some("9-9"), TIMEOUT)
        .err()
        .unwrap();
    assert!(unknown.to_string().contains("no such device"), "{unknown}");
    let setup = Setup {
        kind: Setup::STANDARD_IN,
        request: request::GET_CONFIGURATION,
        length: 1,
        ..Setup::default()
    };
    assert_eq!(first.control(setup, &[], TIMEOUT).unwrap(), [0]);
}
