//! Device time: stepped by a client to the nanosecond, and real time with the lateness of its
//! events.

use crate::served::{LONG, Served, phasmid, serve, text};
use phasmid::host::{CameraDriver, open_camera};
use phasmid::protocol::Endpoints;
use phasmid::protocol::service::{Clock, ClockPace, DeviceAbout, Item, Reply, Request, Step, call};
use rustix::process::Signal;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::process::Stdio;
use std::time::{Duration, Instant};

pub fn service(served: &Served) -> UnixStream {
    let stream = UnixStream::connect(&served.at.service).unwrap();
    stream.set_read_timeout(Some(4 * LONG)).unwrap();
    stream
}

pub fn ask(stream: &mut UnixStream, request: Request) -> Reply {
    call(stream, &request).unwrap().0
}

pub fn refused(stream: &mut UnixStream, request: Request) -> String {
    call(stream, &request).unwrap_err().to_string()
}

fn clock(stream: &mut UnixStream, request: Request) -> Clock {
    ask(stream, request).clock.unwrap()
}

pub fn device(stream: &mut UnixStream) -> DeviceAbout {
    ask(stream, Request::Get(Item::Device)).device.unwrap()
}

#[test]
fn paused_device_goes_on_by_itself_at_another_pace() {
    let served = Served::spawn_as_it_is(serve().args(["--clock", "stepped"]));
    let mut stream = service(&served);
    let mut camera = open_camera(&served.at.camera, CameraDriver::Auto, LONG).unwrap();
    // No other request is made until the frames have come.
    let mut count = |stream: &mut UnixStream, pace, frames| {
        let about = clock(stream, Request::Clock(Step::Pace(pace)));
        assert_eq!(about.pace, pace);
        for _ in 0..frames {
            assert!(camera.next_frame(LONG).unwrap().is_some(), "{pace:?}");
        }
        about.now_ns
    };
    let began = count(&mut stream, ClockPace::Real, 3);
    let paused = count(&mut stream, ClockPace::Stepped, 0);
    assert!(paused > began);
    let again = count(&mut stream, ClockPace::Fast, 3);
    assert_eq!(again, paused, "time stands still when stepped");
    count(&mut stream, ClockPace::Real, 3);
    assert!(clock(&mut stream, Request::Get(Item::Clock)).now_ns > paused);
    served.stop(Signal::TERM);
}

#[test]
fn step_exposes_the_frames_within_it() {
    let served = Served::spawn_as_it_is(serve().args(["--clock", "stepped"]));
    let mut stream = service(&served);
    let mut instrument = served.instrument();
    // Set this before the first reader connects; otherwise the camera would run free as soon as it
    // connects.
    instrument.order("TRIG:SOUR BUS").unwrap();
    let mut camera = open_camera(&served.at.camera, CameraDriver::Auto, LONG).unwrap();
    instrument.order("INIT;*TRG").unwrap();
    let about = clock(&mut stream, Request::Get(Item::Clock));
    assert_eq!((about.pace, about.now_ns), (ClockPace::Stepped, 0));
    assert_eq!(device(&mut stream).state, "running");
    // Exposures last 12 ms and start every 16 ms, so no frame is complete a nanosecond before 12 ms.
    let to = |stream: &mut UnixStream, ns| {
        let about = clock(stream, Request::Clock(Step::RunUntilNs(ns)));
        assert_eq!(about.now_ns, ns);
        device(stream).frames
    };
    assert_eq!(to(&mut stream, 11_999_999), 0);
    assert_eq!(to(&mut stream, 12_000_000), 1);
    assert_eq!(to(&mut stream, 27_999_999), 1);
    let step = Request::Clock(Step::StepNs(1));
    assert_eq!(clock(&mut stream, step).now_ns, 28_000_000);
    assert_eq!(device(&mut stream).frames, 2);
    assert_eq!(to(&mut stream, 1_000_000_000), 13);
    // When the step is answered, all frames have been rendered and sent.
    let idle = device(&mut stream);
    assert_eq!((idle.in_flight, idle.backlog), (0, 0));
    assert_eq!((idle.state.as_str(), idle.camera_clients), ("idle", 1));
    for id in 0..13 {
        let frame = camera.next_frame(LONG).unwrap().unwrap();
        assert_eq!((frame.id, frame.pattern_index), (id, Some(id as u32)));
        assert_eq!(frame.exposure_start_ns, id * 16_000_000);
        assert_eq!(frame.exposure_end_ns, id * 16_000_000 + 12_000_000);
    }
    let words = refused(&mut stream, Request::Clock(Step::RunUntilNs(999_999_999)));
    assert!(words.contains("1000000000 to"), "{words}");
    served.stop(Signal::TERM);
}

#[test]
fn scan_while_stepped_time_stands_still_names_the_clock() {
    let served = Served::spawn_as_it_is(serve().args(["--clock", "stepped"]));
    let scan = served.scan(&served.dir.with_file_name("out"), &["--timeout", "0.5"]);
    assert_eq!(scan.status.code(), Some(1), "{}", text(&scan));
    for words in [
        "no frame within 0.5 s after 0 of 13 frames: the camera was not triggered, or the device's",
        "two runs failed; both: ",
        "the clock of this device is stepped (",
        "{\"clock\":{\"step_ns\":N}} on ",
        "service.sock",
    ] {
        assert!(text(&scan).contains(words), "{words}: {}", text(&scan));
    }
    served.stop(Signal::TERM);
}

#[test]
fn step_of_a_day_can_be_cancelled() {
    let served = Served::spawn_as_it_is(serve().args(["--clock", "stepped"]));
    let mut stream = service(&served);
    // A client reads, so each of the three million frames must be rendered.
    let address = served.at.camera.clone();
    std::thread::spawn(move || {
        let mut camera = open_camera(&address, CameraDriver::Auto, LONG).unwrap();
        while camera.next_frame(LONG).is_ok() {}
    });
    while device(&mut stream).camera_clients == 0 {
        std::thread::sleep(Duration::from_millis(5));
    }
    let day = || Request::Clock(Step::StepNs(86_400_000_000_000));
    let asker = std::thread::spawn({
        let mut stream = service(&served);
        move || refused(&mut stream, day())
    });
    let now = |stream: &mut UnixStream| {
        let about = clock(stream, Request::Get(Item::Clock));
        about.now_ns
    };
    let under_way = |stream: &mut UnixStream, from_ns: u64| {
        while now(stream) <= from_ns {
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    under_way(&mut stream, 0);
    let stopped = clock(&mut stream, Request::Clock(Step::Stop)).now_ns;
    let words = asker.join().unwrap();
    assert!(
        words.ends_with(&format!("cancelled at {stopped} ns")),
        "{words}"
    );
    assert_eq!(now(&mut stream), stopped);
    // A client that disconnects cancels its step, and the next client need not wait for it.
    let mut asker = service(&served);
    asker.write_all(day().to_line().as_bytes()).unwrap();
    under_way(&mut stream, stopped);
    drop(asker);
    let end = std::time::Instant::now() + 4 * LONG;
    loop {
        let before = now(&mut stream);
        std::thread::sleep(Duration::from_millis(200));
        if now(&mut stream) == before {
            break;
        }
        assert!(std::time::Instant::now() < end, "the step has not stopped");
    }
    let before = now(&mut stream);
    let step = Request::Clock(Step::StepNs(1_000_000));
    assert_eq!(clock(&mut stream, step).now_ns, before + 1_000_000);
    served.stop(Signal::TERM);
}

#[test]
fn only_a_stepped_clock_is_stepped() {
    let served = Served::start(&[]);
    let mut stream = service(&served);
    let words = refused(&mut stream, Request::Clock(Step::StepNs(1)));
    assert!(words.contains("--clock stepped"), "{words}");
    let about = clock(&mut stream, Request::Get(Item::Clock));
    assert_eq!((about.pace, about.late), (ClockPace::Fast, None));
    served.stop(Signal::TERM);
}

#[test]
fn real_clock_reports_lateness() {
    let mut command = serve();
    command.args(["--clock", "real", "--camera", "socket"]);
    let base = tempfile::tempdir().unwrap();
    let dir = base.path().join("run");
    let mut child = command
        .arg("--run-dir")
        .arg(&dir)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    while !dir.join("device.json").exists() {
        std::thread::sleep(Duration::from_millis(5));
    }
    let at = phasmid::protocol::Endpoints::read(&dir).unwrap();
    let port = phasmid::host::SerialPort::open(at.control.to_str().unwrap()).unwrap();
    let mut instrument = phasmid::host::Instrument::open(port, LONG).unwrap();
    instrument.order("TRIG:SOUR BUS;:INIT;*TRG").unwrap();
    assert_eq!(instrument.query("*OPC?").unwrap(), "1");
    let mut stream = UnixStream::connect(&at.service).unwrap();
    let about = clock(&mut stream, Request::Get(Item::Clock));
    let late = about.late.unwrap();
    assert!(late.events >= 13 && about.now_ns > 204_000_000, "{about:?}");
    assert!(
        late.mean_ns <= late.max_ns && late.percentile_99_ns <= late.max_ns,
        "{late:?}"
    );
    assert!(late.max_ns > 0, "{late:?}");
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, Signal::TERM).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    let mut said = String::new();
    child
        .stdout
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    let line = said.lines().last().unwrap();
    assert!(
        line.starts_with("device time: ") && line.contains("99 % of them"),
        "{said}"
    );
}

/// A scene that moves, so that each frame needs geometry passes of its own.
const SWINGING: &str = r#"
name = "swinging"
description = "A sphere that swings"
[[object]]
shape = { kind = "sphere", radius_mm = 120.0 }
position_mm = [0.0, 0.0, 950.0]
albedo = 0.5
motion = { period_s = 0.5, keyframes = [
    { time_s = 0.0 },
    { time_s = 0.2, position_mm = [100.0, 0.0, 0.0] },
] }
"#;

#[test]
fn device_that_renders_too_slowly_for_real_time_reports_it_once() {
    let base = tempfile::tempdir().unwrap();
    let scene = base.path().join("swinging.toml");
    std::fs::write(&scene, SWINGING).unwrap();
    let mut command = phasmid();
    command
        .args(["serve", "--profile", "webcam-grey", "--camera", "socket"])
        // The device exposes 500 frames a second; two cores render about 12.
        .args(["--set", "camera.exposure_us=2000"])
        .args(["--set", "camera.frame_interval_us=2000"])
        .args(["--clock", "real", "--scene"])
        .arg(&scene)
        .stderr(Stdio::piped());
    let mut served = Served::spawn_as_it_is(&mut command);
    let mut words = served.child.stderr.take().unwrap();
    assert_eq!(served.at.slowdown, None);
    let mut camera = open_camera(&served.at.camera, CameraDriver::Auto, LONG).unwrap();
    let begin = Instant::now();
    let slowdown = loop {
        camera.next_frame(LONG).unwrap();
        if let Some(slowdown) = Endpoints::read(&served.dir).unwrap().slowdown {
            break slowdown;
        }
        assert!(begin.elapsed() < LONG, "the device does not report it");
    };
    assert!(slowdown >= 1.5, "{slowdown}");
    // Read as many frames as were needed for the first report of a slowdown.
    for _ in 0..15 {
        camera.next_frame(LONG).unwrap();
    }
    let about = clock(&mut service(&served), Request::Get(Item::Clock));
    let rendering = about.rendering.unwrap();
    assert!(rendering.frames >= 27, "{rendering:?}");
    assert!(
        (0.0..1.0).contains(&rendering.real_time_factor),
        "{rendering:?}"
    );
    served.stop(Signal::TERM);
    let mut said = String::new();
    words.read_to_string(&mut said).unwrap();
    let start = format!("phasmid: webcam-grey: frames are rendered {slowdown} times slower than");
    assert!(said.starts_with(&start), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains("--clock fast"), "{said}");
}
