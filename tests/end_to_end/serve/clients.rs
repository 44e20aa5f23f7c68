//! Clients that misbehave do not disturb the device.

use crate::served::{LONG, Served, text};
use phasmid::host::{CommandPort, SerialPort};
use std::fs;
use std::io::Write;
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::time::Duration;

#[test]
fn misbehaving_clients_do_not_disturb_scans() {
    let served = Served::start(&["--tcp", "0"]);
    let camera = served.at.camera.strip_prefix("socket:").unwrap();

    // Connect to every channel and disconnect, without and with garbage in between.
    for garbage in [
        &b""[..],
        b"\xff\x00garbage\n#9999999999\n",
        &[b'x'; 200_000],
    ] {
        for path in [camera, served.at.service.to_str().unwrap()] {
            let mut stream = UnixStream::connect(path).unwrap();
            // The device may close before it has read everything.
            let _ = stream.write_all(garbage);
        }
        let tcp = served.at.camera_tcp.as_ref().unwrap();
        let mut stream = TcpStream::connect(tcp.strip_prefix("tcp:").unwrap()).unwrap();
        let _ = stream.write_all(garbage);
        let mut control = fs::OpenOptions::new()
            .write(true)
            .open(&served.at.control)
            .unwrap();
        control.write_all(garbage).unwrap();
    }

    // A camera client and a service client stop reading for as long as the test runs.
    let stuck_camera = UnixStream::connect(camera).unwrap();
    let mut stuck_service = UnixStream::connect(&served.at.service).unwrap();
    stuck_service.write_all(b"{\"get\":\"truth\"}\n").unwrap();

    // A control client sends queries, never reads, and leaves half a line and half a block.
    {
        let mut control = fs::OpenOptions::new()
            .write(true)
            .open(&served.at.control)
            .unwrap();
        for _ in 0..2000 {
            control.write_all(b"SEQ:DATA?\n").unwrap();
        }
        control.write_all(b"SEQ:IMAG 'x',#6100000abc").unwrap();
    }

    // The device still answers commands, and a scan returns every frame in order.
    let mut instrument = served.instrument();
    assert_eq!(instrument.query("*IDN?").unwrap(), served.at.name);
    drop(instrument);
    for i in 0..2 {
        let out = served.dir.parent().unwrap().join(format!("out{i}"));
        let scan = served.scan(&out, &[]);
        assert_eq!(scan.status.code(), Some(0), "{}", text(&scan));
    }
    drop((stuck_camera, stuck_service));
    served.stop(rustix::process::Signal::TERM);
}

#[test]
fn client_that_stops_reading_gets_an_error_for_lost_replies() {
    let served = Served::start(&[]);
    let mut port = SerialPort::open(served.at.control.to_str().unwrap()).unwrap();
    port.send(b"*IDN?\n", LONG).unwrap();
    let mut buffer = vec![0; 1 << 16];
    let idn = port.receive(&mut buffer, LONG).unwrap();
    assert_eq!(buffer[..idn], *format!("{}\n", served.at.name).as_bytes());
    // The kernel buffers about 6500 of these lines. When the last line has been sent, the device has
    // therefore answered the others, with far more than the 1 MiB that it keeps.
    const LINES: usize = 9000;
    let one = {
        port.send(b"SEQ:DATA?\n", LONG).unwrap();
        port.receive(&mut buffer, LONG).unwrap()
    };
    for _ in 0..LINES / 100 {
        port.send(&b"SEQ:DATA?\n".repeat(100), LONG).unwrap();
    }
    let mut all = Vec::new();
    loop {
        let len = port
            .receive(&mut buffer, Duration::from_millis(400))
            .unwrap();
        all.extend_from_slice(&buffer[..len]);
        if len == 0 {
            break;
        }
    }
    assert!(
        all.len() > 1 << 19 && all.len() < LINES * one,
        "{} bytes",
        all.len()
    );
    assert!(all.len().is_multiple_of(one), "only whole replies are lost");
    port.send(b"SYST:ERR?\n", LONG).unwrap();
    let len = port.receive(&mut buffer, LONG).unwrap();
    assert!(
        buffer[..len].starts_with(b"-430,"),
        "{}",
        buffer[..len].escape_ascii()
    );
    served.stop(rustix::process::Signal::TERM);
}
