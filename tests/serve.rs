//! `phasma serve` and `phasma scan` as processes: ports, sockets, signals, and clients that
//! misbehave.

use phasma::host::{CommandPort, Instrument, SerialPort, open_camera};
use phasma::protocol::{Endpoints, service};
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const LONG: Duration = Duration::from_secs(5);

/// A device that is served; gone with the test.
struct Served {
    child: Child,
    dir: PathBuf,
    at: Endpoints,
    _base: tempfile::TempDir,
}

fn phasma() -> Command {
    Command::new(env!("CARGO_BIN_EXE_phasma"))
}

impl Served {
    fn start(args: &[&str]) -> Self {
        let base = tempfile::tempdir().unwrap();
        let dir = base.path().join("run");
        let child = phasma()
            .args([
                "serve",
                "--profile",
                "webcam-grey",
                "--scene",
                "plane",
                "--clock",
                "fast",
            ])
            .arg("--run-dir")
            .arg(&dir)
            .args(args)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let mut served = Self {
            child,
            at: Endpoints {
                name: String::new(),
                pid: 0,
                profile: String::new(),
                scene: String::new(),
                seed: 0,
                control: PathBuf::new(),
                camera: String::new(),
                camera_tcp: None,
                service: PathBuf::new(),
            },
            dir,
            _base: base,
        };
        let end = Instant::now() + LONG;
        while !served.dir.join("device.json").exists() {
            assert!(Instant::now() < end, "the device does not come up");
            assert!(
                served.child.try_wait().unwrap().is_none(),
                "the device has gone"
            );
            std::thread::sleep(Duration::from_millis(5));
        }
        served.at = Endpoints::read(&served.dir).unwrap();
        served
    }

    fn instrument(&self) -> Instrument<SerialPort> {
        let port = SerialPort::open(self.at.control.to_str().unwrap()).unwrap();
        Instrument::open(port, LONG).unwrap()
    }

    fn scan(&self, out: &Path, args: &[&str]) -> Output {
        phasma()
            .args(["scan", "--camera", &self.at.camera, "--control"])
            .arg(&self.at.control)
            .arg("--out")
            .arg(out)
            .args(args)
            .output()
            .unwrap()
    }

    fn stop(mut self, signal: rustix::process::Signal) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, signal).unwrap();
        let status = self.child.wait().unwrap();
        assert_eq!(status.code(), Some(0), "{status}");
        assert!(!self.dir.exists(), "nothing is left behind");
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

#[test]
fn a_scan_over_pty_and_socket_leaves_what_a_decoder_needs() {
    let served = Served::start(&["--seed", "7"]);
    assert_eq!(served.at.seed, 7);
    assert_eq!(
        fs::metadata(&served.dir).unwrap().permissions().mode() & 0o777,
        0o700
    );
    let out = served.dir.parent().unwrap().join("out");
    let scan = served.scan(&out, &["--json"]);
    assert_eq!(scan.status.code(), Some(0), "{}", text(&scan));
    let summary: serde_json::Value = serde_json::from_slice(&scan.stdout).unwrap();
    assert_eq!(summary["frames"], 13);
    assert_eq!(
        summary["first_id"], 0,
        "nothing was exposed before the scan"
    );
    assert_eq!(summary["calibration"], "device");
    let source = served.instrument().query("TRIG:SOUR?").unwrap();
    assert_eq!(source, "INT", "left as it was found");
    for name in [
        "frame_00.png",
        "frame_12.png",
        "sequence.toml",
        "calibration.toml",
    ] {
        assert!(out.join(name).is_file(), "{name}");
    }
    let again = served.scan(&out, &[]);
    assert_eq!(again.status.code(), Some(2), "{}", text(&again));
    assert!(text(&again).contains("--force"), "{}", text(&again));
    assert!(served.scan(&out, &["--force"]).status.success());
    let moon = served.scan(&out, &["--force", "--sequence", "moon"]);
    assert_eq!(moon.status.code(), Some(1), "{}", text(&moon));
    assert!(text(&moon).contains("-256"), "{}", text(&moon));
    served.stop(rustix::process::Signal::TERM);
}

#[test]
fn same_seed_and_triggers_same_bytes() {
    let frames = |threads: &str| {
        let base = tempfile::tempdir().unwrap();
        let dir = base.path().join("run");
        let mut child = phasma()
            .args([
                "serve",
                "--profile",
                "webcam-grey",
                "--scene",
                "plane",
                "--clock",
                "fast",
            ])
            .arg("--run-dir")
            .arg(&dir)
            .env("RAYON_NUM_THREADS", threads)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let end = Instant::now() + LONG;
        while !dir.join("device.json").exists() && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(5));
        }
        let at = Endpoints::read(&dir).unwrap();
        let port = SerialPort::open(at.control.to_str().unwrap()).unwrap();
        let mut instrument = Instrument::open(port, LONG).unwrap();
        instrument.order("TRIG:SOUR BUS").unwrap();
        let mut camera = open_camera(&at.camera, LONG).unwrap();
        instrument.tell("INIT;*TRG").unwrap();
        let frames: Vec<_> = (0..13)
            .map(|_| camera.next_frame(LONG).unwrap().unwrap())
            .collect();
        child.kill().unwrap();
        child.wait().unwrap();
        frames
    };
    assert!(
        frames("1") == frames("2"),
        "ids, times and pixels are the same"
    );
}

#[test]
fn frames_come_over_tcp_and_run_free() {
    let served = Served::start(&["--tcp", "0"]);
    let mut camera = open_camera(served.at.camera_tcp.as_ref().unwrap(), LONG).unwrap();
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
    served.stop(rustix::process::Signal::INT);
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
        phasma::emulator::Truth::from_maps(maps).unwrap();
    }
    // A mistake is answered and the conversation goes on.
    stream.write_all(b"{\"get\":\"moon\"}\n").unwrap();
    let mut byte = [0];
    let mut line = Vec::new();
    while stream.read(&mut byte).unwrap() == 1 && byte[0] != b'\n' {
        line.push(byte[0]);
    }
    assert!(service::Reply::parse(&line).unwrap().error.is_some());
    // The external trigger is a wire, not a command.
    let mut instrument = served.instrument();
    instrument.order("TRIG:SOUR EXT;:INIT").unwrap();
    service::ask(&mut stream, service::Request::Do(service::Action::Trigger)).unwrap();
    assert_eq!(instrument.query("*OPC?;:DIAG:FRAM?").unwrap(), "1;13");
    // The control port knows nothing of it.
    assert!(
        instrument
            .order("DIAG:TRUT?")
            .unwrap_err()
            .to_string()
            .contains("-113")
    );
    served.stop(rustix::process::Signal::TERM);
}

#[test]
fn clients_that_misbehave_do_no_harm() {
    let served = Served::start(&["--tcp", "0"]);
    let camera = served.at.camera.strip_prefix("socket:").unwrap();

    // Connect and go; connect, talk garbage and go; on every channel.
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

    // A camera client and a service client that stop reading, for as long as the test runs.
    let stuck_camera = UnixStream::connect(camera).unwrap();
    let mut stuck_service = UnixStream::connect(&served.at.service).unwrap();
    stuck_service.write_all(b"{\"get\":\"truth\"}\n").unwrap();

    // A control client that asks and never reads, and leaves half a line and half a block.
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

    // And still: a conversation, and a scan with every frame in order.
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
fn a_client_that_stops_reading_replies_is_told_of_it() {
    let served = Served::start(&[]);
    let mut port = SerialPort::open(served.at.control.to_str().unwrap()).unwrap();
    port.send(b"*IDN?\n", LONG).unwrap();
    let mut buffer = vec![0; 1 << 16];
    let idn = port.receive(&mut buffer, LONG).unwrap();
    assert_eq!(buffer[..idn], *format!("{}\n", served.at.name).as_bytes());
    // The kernel holds some 6500 of these lines, so the device has answered the others by the time
    // the last one is sent: with far more than the 1 MiB that it keeps.
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
    assert!(
        all.len().is_multiple_of(one),
        "replies are lost whole or not at all"
    );
    port.send(b"SYST:ERR?\n", LONG).unwrap();
    let len = port.receive(&mut buffer, LONG).unwrap();
    assert!(
        buffer[..len].starts_with(b"-430,"),
        "{}",
        buffer[..len].escape_ascii()
    );
    served.stop(rustix::process::Signal::TERM);
}

#[test]
fn one_directory_serves_one_device_and_a_killed_one_is_succeeded() {
    let mut served = Served::start(&[]);
    let second = |dir: &Path| {
        phasma()
            .args([
                "serve",
                "--profile",
                "webcam-grey",
                "--scene",
                "plane",
                "--run-dir",
            ])
            .arg(dir)
            .output()
            .unwrap()
    };
    let refused = second(&served.dir);
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(
        text(&refused).contains("serves a device"),
        "{}",
        text(&refused)
    );
    assert_eq!(served.instrument().query("*TST?").unwrap(), "0", "unharmed");
    served.child.kill().unwrap();
    served.child.wait().unwrap();
    assert!(
        served.dir.join("device.json").exists(),
        "a killed device cannot clean up"
    );
    let mut child = phasma()
        .args([
            "serve",
            "--profile",
            "webcam-grey",
            "--scene",
            "plane",
            "--run-dir",
        ])
        .arg(&served.dir)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = [0; 11];
    child
        .stdout
        .as_mut()
        .unwrap()
        .read_exact(&mut line)
        .unwrap();
    assert_eq!(&line, b"webcam-grey");
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(!served.dir.exists());
}

#[test]
fn a_sequence_from_a_file_is_projected() {
    let base = tempfile::tempdir().unwrap();
    let file = base.path().join("mine.toml");
    let manifest = "[projector]\nwidth_px = 854\nheight_px = 480\n\
        [[frame]]\npattern = { kind = \"image\", file = \"dots.png\" }\n\
        [[frame]]\npattern = { kind = \"white\" }\n";
    fs::write(&file, manifest).unwrap();
    let missing = phasma()
        .args([
            "serve",
            "--profile",
            "webcam-grey",
            "--scene",
            "plane",
            "--sequence",
        ])
        .arg(&file)
        .output()
        .unwrap();
    assert_eq!(missing.status.code(), Some(2), "{}", text(&missing));
    assert!(text(&missing).contains("dots.png"), "{}", text(&missing));
    image::GrayImage::new(854, 480)
        .save(base.path().join("dots.png"))
        .unwrap();
    let served = Served::start(&["--sequence", file.to_str().unwrap()]);
    let out = base.path().join("out");
    // Nothing in it can be decoded: said so, with the frames kept, unless it is not asked for.
    let scan = served.scan(&out, &["--sequence", "mine"]);
    assert_eq!(scan.status.code(), Some(2), "{}", text(&scan));
    assert!(text(&scan).contains("neither fringes nor Gray code"));
    let scan = served.scan(
        &out,
        &["--sequence", "mine", "--json", "--no-decode", "--force"],
    );
    assert_eq!(scan.status.code(), Some(0), "{}", text(&scan));
    assert!(out.join("frame_01.png").exists() && !out.join("frame_02.png").exists());
    served.stop(rustix::process::Signal::TERM);
}

#[test]
fn nobody_there_is_said_so() {
    let base = tempfile::tempdir().unwrap();
    let scan = |camera: &str, control: &str| {
        phasma()
            .args(["scan", "--camera", camera, "--control", control, "--out"])
            .arg(base.path().join("out"))
            .output()
            .unwrap()
    };
    let none = scan("socket:/no/such/socket", "/no/such/port");
    assert_eq!(none.status.code(), Some(2), "{}", text(&none));
    assert!(text(&none).contains("/no/such/port"), "{}", text(&none));
    let not_a_port = scan("socket:/no/such/socket", "/dev/null");
    assert_eq!(not_a_port.status.code(), Some(1), "{}", text(&not_a_port));
    let served = Served::start(&[]);
    let video = scan("/dev/video10", served.at.control.to_str().unwrap());
    assert_eq!(video.status.code(), Some(2), "{}", text(&video));
    assert!(text(&video).contains("V4L2"), "{}", text(&video));
}
