//! The device over USB/IP between processes: `phasmid serve --usb` and `phasmid scan --device`,
//! without a kernel in between.

use crate::served::{LONG, Served, phasmid, text};
use phasmid::host::usb::{Client, UsbAddress, UsbCamera, UsbDevice, UsbPort};
use phasmid::host::{Camera, CommandPort, Instrument, SerialPort};
use phasmid::protocol::service;
use phasmid::protocol::usb::cdc::LineCoding;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Writes a built-in profile, with one replacement and one addition, to a file and returns its path.
fn profile(dir: &Path, name: &str, change: (&str, &str), usb: &str) -> PathBuf {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("device-profiles");
    let text = fs::read_to_string(shipped.join(format!("{name}.toml"))).unwrap();
    let changed = text.replace(change.0, change.1);
    assert_eq!(changed != text, change.0 != change.1, "{change:?}");
    let path = dir.join("profile.toml");
    fs::write(&path, format!("{changed}\n[usb]\n{usb}\n")).unwrap();
    path
}

const AS_IT_IS: (&str, &str) = ("", "");

fn serve(profile: &Path) -> Command {
    let mut command = phasmid();
    command.args(["serve", "--scene", "plane", "--seed", "5", "--profile"]);
    command.arg(profile);
    command
}

/// Returns the command `phasmid serve` with the device exported over USB/IP on a free port.
fn serve_usb(profile: &Path) -> Command {
    let mut command = serve(profile);
    command.args(["--usb", "export", "--usb-listen", "127.0.0.1:0"]);
    command
}

fn scan(address: &str, out: &Path) -> Command {
    let mut command = phasmid();
    command
        .args(["scan", "--device", address, "--out"])
        .arg(out);
    command
}

/// Returns the files of a folder and their contents.
fn contents(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(dir).unwrap().map(Result::unwrap);
    entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        })
        .collect()
}

/// Two devices with the same profile, scene and seed, one scanned over USB and the other over pty
/// and frame socket, produce identical bytes: frames, maps, cloud, manifest and calibration.
fn leaves_what_the_socket_leaves(name: &str, usb: &str) {
    let dir = tempfile::tempdir().unwrap();
    let profile = profile(dir.path(), name, AS_IT_IS, usb);
    let over_usb = dir.path().join("usb");
    let served = Served::spawn(&mut serve_usb(&profile));
    let scanned = scan(&served.at.camera, &over_usb).output().unwrap();
    assert_eq!(scanned.status.code(), Some(0), "{}", text(&scanned));
    served.stop(rustix::process::Signal::TERM);
    let over_socket = dir.path().join("socket");
    let served = Served::spawn(serve(&profile).args(["--camera", "socket"]));
    let scanned = served.scan(&over_socket, &[]);
    assert_eq!(scanned.status.code(), Some(0), "{}", text(&scanned));
    let (usb, socket) = (contents(&over_usb), contents(&over_socket));
    assert!(usb.contains_key("cloud.ply") && usb.contains_key("frame_12.png"));
    assert!(usb.keys().eq(socket.keys()), "{:?}", usb.keys());
    for (file, bytes) in &usb {
        assert!(*bytes == socket[file], "{file} differs over USB");
    }
}

#[test]
fn high_speed_bulk_scan_equals_that_of_the_socket() {
    leaves_what_the_socket_leaves("pmp-bench", "speed = 'high'\ntransfer = 'bulk'");
}

#[test]
fn superspeed_bulk_scan_equals_that_of_the_socket() {
    leaves_what_the_socket_leaves("webcam-grey", "speed = 'super'\ntransfer = 'bulk'");
}

#[test]
fn high_speed_isochronous_scan_equals_that_of_the_socket() {
    leaves_what_the_socket_leaves("webcam-grey", "speed = 'high'\ntransfer = 'isochronous'");
}

#[test]
fn superspeed_isochronous_scan_equals_that_of_the_socket() {
    leaves_what_the_socket_leaves("pmp-bench", "speed = 'super'\ntransfer = 'isochronous'");
}

/// Returns `HOST:PORT` of a served device.
fn host(served: &Served) -> String {
    UsbAddress::parse(&served.at.camera, "device.json")
        .unwrap()
        .host
}

/// Runs a command that must exit soon, with this status and a single line for the user that contains
/// `says`.
fn refusal(command: &mut Command, status: i32, says: &str) {
    let start = Instant::now();
    let output = command.stdin(Stdio::null()).output().unwrap();
    assert!(start.elapsed() < LONG, "{command:?} takes too long");
    one_message(&output, status, says);
}

fn one_message(output: &Output, status: i32, says: &str) {
    let words = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(status), "{words}");
    assert_eq!(words.lines().count(), 1, "{words}");
    assert!(words.contains(says), "{words:?}, expected {says:?}");
}

#[test]
fn unavailable_addresses_ports_and_devices_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let profile = profile(dir.path(), "webcam-grey", AS_IT_IS, "");
    let served = Served::spawn(&mut serve_usb(&profile));
    let out = dir.path().join("out");
    let host = host(&served);

    // A second server cannot listen on a used address, and leaves no files behind.
    let run = dir.path().join("second");
    let second = |listen: &str| {
        let mut command = serve(&profile);
        command.args(["--usb", "--usb-listen", listen, "--run-dir"]);
        command.arg(&run);
        command
    };
    refusal(
        &mut second(&host),
        1,
        &format!("{host}: something else listens there"),
    );
    // RFC 5737 reserves this address, so no machine has it.
    refusal(&mut second("192.0.2.1:3240"), 1, "192.0.2.1:3240");
    assert!(!run.exists());

    for (address, status, says) in [
        ("usb:", 2, "usb:HOST:PORT"),
        ("usb:localhost", 2, "usb:HOST:PORT"),
        ("usb:localhost:0", 2, "1 to 65535"),
        ("usb:localhost:99999", 2, "1 to 65535"),
        ("/dev/video0", 2, "usb:HOST:PORT"),
        (&format!("usb:{host}/"), 2, "usb:HOST:PORT/BUSID"),
        (&format!("usb:{host}/7-7"), 1, "no such device"),
        // A privileged port, which is closed unless a privileged process has opened it.
        ("usb:127.0.0.1:1", 1, "usb:127.0.0.1:1: Connection refused"),
    ] {
        refusal(&mut scan(address, &out), status, says);
    }
    // A service that does not speak USB/IP: a listener that sends a greeting as web servers do.
    let other = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("usb:{}", other.local_addr().unwrap());
    let greeter = std::thread::spawn(move || {
        use std::io::Write;
        let (mut client, _) = other.accept().unwrap();
        client.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n")
    });
    refusal(&mut scan(&address, &out), 1, "not a USB/IP server");
    greeter.join().unwrap().unwrap();

    // Only one host can use the device at a time; the next one can connect after the first has
    // disconnected.
    let first = Client::import(&host, None, LONG).unwrap();
    refusal(&mut scan(&served.at.camera, &out), 1, "another host");
    assert!(!out.exists(), "refused before anything is captured");
    drop(first);
    scan_when_free(&served.at.camera, &out);
}

/// Retries a scan until the server has noticed that the previous host has disconnected.
fn scan_when_free(address: &str, out: &Path) -> Output {
    let end = Instant::now() + LONG;
    loop {
        let scanned = scan(address, out)
            .args(["--json", "--force"])
            .output()
            .unwrap();
        if scanned.status.code() == Some(0) {
            return scanned;
        }
        let words = text(&scanned);
        assert!(
            words.contains("another host") && Instant::now() < end,
            "{words}"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn public_listen_address_is_warned_of() {
    let dir = tempfile::tempdir().unwrap();
    let profile = profile(dir.path(), "webcam-grey", AS_IT_IS, "");
    for (listen, warned) in [
        ("0.0.0.0:0", true),
        ("127.0.0.1:0", false),
        ("[::1]:0", false),
    ] {
        if listen.starts_with('[') && std::net::TcpListener::bind(listen).is_err() {
            continue;
        }
        let run = dir.path().join("run");
        let mut child = serve(&profile)
            .args(["--usb", "--usb-listen", listen, "--run-dir"])
            .arg(&run)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let end = Instant::now() + LONG;
        while !run.join("device.json").exists() {
            assert!(Instant::now() < end, "the device does not start");
            std::thread::sleep(Duration::from_millis(5));
        }
        let pid = rustix::process::Pid::from_child(&child);
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0));
        let words = std::io::read_to_string(child.stderr.take().unwrap()).unwrap();
        assert_eq!(
            words.contains("no authentication"),
            warned,
            "{listen}: {words}"
        );
        assert_eq!(words.lines().count(), usize::from(warned), "{words}");
    }
}

/// Serves a device in real time with a sequence of two seconds, so that it can be interrupted in the
/// middle.
fn slow(dir: &Path) -> Served {
    let period = ("period_us = 16000.0", "period_us = 150000.0");
    let profile = profile(dir, "webcam-grey", period, "");
    Served::spawn_as_it_is(serve_usb(&profile).args(["--clock", "real"]))
}

/// Starts a scan and returns it while it is far from finished.
fn begun(served: &Served, out: &Path) -> Child {
    let mut scan = scan(&served.at.camera, out)
        // This timeout is much longer than the tests wait.
        .args(["--timeout", "600"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Frames are rendered only for a connected reader.
    while rendering_us(served) == 0 {
        assert!(scan.try_wait().unwrap().is_none(), "the scan has ended");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(scan.try_wait().unwrap().is_none(), "the scan is over");
    scan
}

#[test]
fn a_device_that_is_killed_in_the_middle_of_a_scan_is_one_error() {
    let dir = tempfile::tempdir().unwrap();
    let mut served = slow(dir.path());
    let out = dir.path().join("out");
    let scan = begun(&served, &out);
    served.child.kill().unwrap();
    let start = Instant::now();
    let ended = scan.wait_with_output().unwrap();
    assert!(
        start.elapsed() < LONG / 2,
        "the scan does not wait for a killed server"
    );
    one_message(&ended, 1, "disconnected");
    assert!(text(&ended).contains(&served.at.camera), "{}", text(&ended));
    assert!(!out.exists(), "no partial output");
}

#[test]
fn a_client_that_is_killed_in_the_middle_of_a_scan_leaves_the_device_free() {
    let dir = tempfile::tempdir().unwrap();
    let served = slow(dir.path());
    let out = dir.path().join("out");
    let mut scan = begun(&served, &out);
    scan.kill().unwrap();
    scan.wait().unwrap();
    let next = scan_when_free(&served.at.camera, &out);
    let summary: serde_json::Value = serde_json::from_slice(&next.stdout).unwrap();
    assert_eq!(summary["frames"], 13);
    served.stop(rustix::process::Signal::TERM);
}

/// Returns the time in microseconds that the device has spent on rendering frames.
fn rendering_us(served: &Served) -> u64 {
    let mut stream = UnixStream::connect(&served.at.service).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    let request = service::Request::Get(service::Item::Truth);
    service::ask(&mut stream, request).unwrap().render_us
}

#[test]
fn unread_camera_is_not_rendered() {
    let dir = tempfile::tempdir().unwrap();
    let profile = profile(dir.path(), "webcam-grey", AS_IT_IS, "");
    let served = Served::spawn_as_it_is(serve_usb(&profile).args(["--clock", "real"]));
    let address = UsbAddress::parse(&served.at.camera, "device.json").unwrap();
    let device = Arc::new(UsbDevice::open(&address, LONG).unwrap());
    let mut instrument = Instrument::open(UsbPort::open(&device).unwrap(), LONG).unwrap();
    // The wait takes about five frame times.
    let a_while = || std::thread::sleep(Duration::from_millis(170));

    // The device is attached and configured, and a program has opened the port.
    a_while();
    assert_eq!(instrument.query("DIAG:FRAM?").unwrap(), "0");
    // A sequence is exposed even without a reader.
    let exposed = instrument.query("TRIG:SOUR BUS;:INIT;*TRG;*OPC?;:DIAG:FRAM?");
    assert_eq!(exposed.unwrap(), "1;13");
    assert_eq!(rendering_us(&served), 0);

    instrument.order("TRIG:SOUR INT").unwrap();
    let mut camera = UsbCamera::open(&device, None).unwrap();
    for _ in 0..3 {
        camera.next_frame(LONG).unwrap().expect("a frame");
    }
    assert!(rendering_us(&served) > 0);

    drop(camera);
    // The sequence in progress finishes.
    a_while();
    let state = |instrument: &mut Instrument<UsbPort>| {
        (
            instrument.query("DIAG:FRAM?").unwrap(),
            rendering_us(&served),
        )
    };
    let before = state(&mut instrument);
    a_while();
    assert_eq!(state(&mut instrument), before);
}

/// Sends a line over a port and returns the reply line.
fn ask(port: &mut impl CommandPort, words: &str) -> String {
    port.send(format!("{words}\n").as_bytes(), LONG).unwrap();
    line(port)
}

/// Reads the next line from a port.
fn line(port: &mut impl CommandPort) -> String {
    let mut answer = Vec::new();
    while answer.last() != Some(&b'\n') {
        let mut buffer = [0; 256];
        let len = port.receive(&mut buffer, LONG).unwrap();
        assert!(len > 0, "no answer: {}", answer.escape_ascii());
        answer.extend_from_slice(&buffer[..len]);
    }
    String::from_utf8(answer).unwrap().trim_end().to_owned()
}

#[test]
fn line_coding_breaks_and_lines_reach_the_firmware() {
    let dir = tempfile::tempdir().unwrap();
    let uses = "rts = 'trigger'\ndsr = 'sync'";
    let profile = profile(dir.path(), "webcam-grey", AS_IT_IS, uses);
    let served = Served::spawn(&mut serve_usb(&profile));
    let address = UsbAddress::parse(&served.at.camera, "device.json").unwrap();
    let device = Arc::new(UsbDevice::open(&address, LONG).unwrap());
    let mut port = UsbPort::open(&device).unwrap();

    let asked = "SYST:COMM:SER:BAUD?;BITS?;PAR?;SBIT?";
    assert_eq!(ask(&mut port, asked), "115200;8;NONE;1");
    for (coding, told) in [
        ((9600, 7, 2, 2), "9600;7;EVEN;2"),
        ((300, 5, 3, 1), "300;5;ONE;1.5"),
        ((3_000_000, 16, 4, 0), "3000000;16;ZERO;1"),
        ((1200, 8, 1, 0), "1200;8;ODD;1"),
    ] {
        let (baud, data_bits, parity, stop_bits) = coding;
        let coding = LineCoding {
            baud,
            stop_bits,
            parity,
            data_bits,
        };
        port.set_line_coding(coding).unwrap();
        assert_eq!(ask(&mut port, asked), told);
    }

    // A break, or a closed terminal, discards an unfinished line.
    port.send(b"nonsense, and without an end", LONG).unwrap();
    port.send_break(0xFFFF).unwrap();
    port.send_break(0).unwrap();
    assert_eq!(ask(&mut port, "SYST:ERR:COUN?"), "0");
    port.send(b"nonsense, and without an end", LONG).unwrap();
    drop(port);
    let mut port = UsbPort::open(&device).unwrap();
    assert_eq!(ask(&mut port, "SYST:ERR:COUN?"), "0");

    // A rising edge of RTS is a trigger; a constant or falling RTS is not. DSR is high during an
    // exposure.
    let count = ask(&mut port, "TRIG:SOUR EXT;MODE STEP;:INIT;:DIAG:FRAM?");
    assert_eq!(count, "0");
    for (rts, frames) in [
        (false, "0"),
        (true, "1"),
        (true, "1"),
        (false, "1"),
        (true, "2"),
        (false, "2"),
    ] {
        port.set_rts(rts).unwrap();
        // An exposure starts only after the previous period, and a trigger during that period is
        // ignored, so wait until the device is ready. A missed trigger fails here; an extra trigger
        // fails at the next change of RTS.
        let end = Instant::now() + LONG;
        while ask(&mut port, "DIAG:FRAM?") != frames || ask(&mut port, "STAT:OPER:COND?") != "32" {
            assert!(
                Instant::now() < end,
                "RTS {rts}: want {frames} frames, and to wait"
            );
        }
    }
    assert_eq!(ask(&mut port, "SYST:ERR:COUN?"), "0");
    assert!(port.wait_for_lines(|lines| !lines.dsr, LONG).unwrap());
}

/// The pty and the USB port are two endpoints of one port: closing one does not disturb the other.
#[test]
fn closing_pty_or_usb_end_does_not_disturb_the_other() {
    let dir = tempfile::tempdir().unwrap();
    let profile = profile(dir.path(), "webcam-grey", AS_IT_IS, "");
    let mut command = serve_usb(&profile);
    let served = Served::spawn_as_it_is(command.args(["--clock", "real"]));
    let address = UsbAddress::parse(&served.at.camera, "device.json").unwrap();
    let slow = "TRIG:SOUR BUS;MODE SEQ;:INIT;*TRG;*OPC?\n";

    let mut pty = SerialPort::open(served.at.control.to_str().unwrap()).unwrap();
    pty.send(slow.as_bytes(), LONG).unwrap();
    let device = Arc::new(UsbDevice::open(&address, LONG).unwrap());
    drop(UsbPort::open(&device).unwrap());
    assert_eq!(line(&mut pty), "1", "the answer goes to the pty");

    let mut usb = UsbPort::open(&device).unwrap();
    usb.send(slow.as_bytes(), LONG).unwrap();
    drop(pty);
    assert_eq!(line(&mut usb), "1", "the answer goes over USB");
    assert_eq!(ask(&mut usb, "SYST:ERR:COUN?"), "0");
}
