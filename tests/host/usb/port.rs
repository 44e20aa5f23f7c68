//! The serial port: bytes both ways, lines, breaks, and the camera beside it.

use crate::usb::served::{Served, TIMEOUT, frame};
use phasmid::host::usb::{UsbCamera, UsbPort};
use phasmid::host::{Camera, CommandPort};
use phasmid::link::usb::Event;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::PixelFormat;
use phasmid::protocol::usb::cdc::{DeviceLines, HostLines, LineCoding};
use std::time::Duration;

fn read(port: &mut UsbPort, len: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    while bytes.len() < len {
        let mut buffer = [0; 1000];
        let got = port.receive(&mut buffer, TIMEOUT).unwrap();
        assert!(got > 0, "{} of {len} bytes", bytes.len());
        bytes.extend(&buffer[..got]);
    }
    bytes
}

#[test]
fn port_echoes_beside_a_stream() {
    let served = Served::new(Speed::High, Transfer::Bulk);
    let device = served.open();
    let mut port = UsbPort::open(&device).unwrap();
    let mut camera = UsbCamera::open(&device, None).unwrap();
    let mut buffer = [0; 10];
    assert_eq!(
        port.receive(&mut buffer, Duration::from_millis(5)).unwrap(),
        0
    );
    for id in 0..100 {
        let line = format!("meas:volt? {id};*idn?\n");
        port.send(line.as_bytes(), TIMEOUT).unwrap();
        assert_eq!(read(&mut port, line.len()), line.to_uppercase().as_bytes());
        let got = camera.next_frame(TIMEOUT).unwrap().expect("a frame");
        assert!(got.data == frame(id, PixelFormat::Grey).data, "frame {id}");
    }
}

#[test]
fn long_data_is_echoed_whole() {
    let served = Served::new(Speed::Super, Transfer::Bulk);
    let mut port = UsbPort::open(&served.open()).unwrap();
    let bytes: Vec<u8> = (0..300_000u32)
        .map(|i| b'a' + (i.wrapping_mul(i) >> 5) as u8 % 26)
        .collect();
    port.send(&bytes, TIMEOUT).unwrap();
    // More than the port buffers: the device must wait.
    std::thread::sleep(Duration::from_millis(50));
    assert!(read(&mut port, bytes.len()) == bytes.to_ascii_uppercase());
}

#[test]
fn control_lines_and_breaks_reach_the_other_side() {
    let served = Served::new(Speed::High, Transfer::Bulk);
    let device = served.open();
    let mut port = UsbPort::open(&device).unwrap();
    let lines = |dtr, rts| Event::Lines(HostLines { dtr, rts });
    served.wait(|event| *event == Event::LineCoding(LineCoding::default()));
    served.wait(|event| *event == lines(true, true));
    port.set_rts(false).unwrap();
    served.wait(|event| *event == lines(true, false));
    port.set_rts(true).unwrap();
    served.wait(|event| *event == lines(true, true));
    port.send_break(0xFFFF).unwrap();
    port.send_break(0).unwrap();
    served.wait(|event| *event == Event::Break(true));
    served.wait(|event| *event == Event::Break(false));
    let coding = LineCoding {
        baud: 9600,
        stop_bits: 2,
        parity: 1,
        data_bits: 7,
    };
    port.set_line_coding(coding).unwrap();
    assert_eq!(port.line_coding().unwrap(), coding);
    for dsr in [true, false, true] {
        let told = DeviceLines { dcd: !dsr, dsr };
        served.device().set_lines(told, served.start.elapsed());
        assert!(port.wait_for_lines(|lines| lines == told, TIMEOUT).unwrap());
        assert_eq!(port.device_lines(), told);
    }
    assert!(
        !port
            .wait_for_lines(|lines| !lines.dsr, Duration::from_millis(10))
            .unwrap()
    );
    drop(port);
    served.wait(|event| *event == lines(false, false));
    // The port can be reopened after the first user has closed it.
    let mut port = UsbPort::open(&device).unwrap();
    port.send(b"again", TIMEOUT).unwrap();
    assert_eq!(read(&mut port, 5), b"AGAIN");
}
