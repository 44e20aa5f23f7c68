//! Several devices listed in a station file, with one clock and one scene.

use crate::serve::clock::{ask, device};
use crate::served::{LONG, phasmid, text};
use phasmid::host::{Instrument, SerialPort};
use phasmid::protocol::Endpoints;
use phasmid::protocol::service::{Item, Maps, Placement, Request, Step, call};
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

const STATION: &str = "name = \"pair\"\ndescription = \"Two before a wall\"\nscene = \"wall.toml\"\n\
    [[device]]\nname = \"near\"\nprofile = \"webcam-grey\"\nseed = 5\n\
    [[device]]\nname = \"far\"\nprofile = \"webcam-grey\"\nposition_mm = [0.0, 0.0, -200.0]\n";

/// Two devices; dropping this value stops them.
struct Pair {
    child: Child,
    at: [Endpoints; 2],
    base: tempfile::TempDir,
}

impl Pair {
    fn start(clock: &str) -> Self {
        let base = tempfile::tempdir().unwrap();
        let file = station(base.path());
        let run = base.path().join("run");
        let mut child = phasmid()
            .args(["serve", "--clock", clock, "--profile"])
            .arg(file)
            .arg("--run-dir")
            .arg(&run)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let end = Instant::now() + 4 * LONG;
        let dirs = ["near", "far"].map(|name| run.join(name));
        while !dirs.iter().all(|dir| dir.join("device.json").exists()) {
            assert!(Instant::now() < end, "the devices do not start");
            assert!(child.try_wait().unwrap().is_none(), "the server has ended");
            std::thread::sleep(Duration::from_millis(5));
        }
        let at = dirs.map(|dir| Endpoints::read(&dir).unwrap());
        Self { child, at, base }
    }

    fn services(&self) -> [UnixStream; 2] {
        self.at.each_ref().map(|at| {
            let stream = UnixStream::connect(&at.service).unwrap();
            stream.set_read_timeout(Some(4 * LONG)).unwrap();
            stream
        })
    }

    fn instrument(&self, number: usize) -> Instrument<SerialPort> {
        let port = SerialPort::open(self.at[number].control.to_str().unwrap()).unwrap();
        Instrument::open(port, LONG).unwrap()
    }
}

impl Drop for Pair {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Writes a station file and its scene, and returns the path of the station file.
fn station(folder: &Path) -> PathBuf {
    let wall = include_str!("../../../device-profiles/scenes/plane.toml");
    fs::write(folder.join("wall.toml"), wall).unwrap();
    let file = folder.join("pair.toml");
    fs::write(&file, STATION).unwrap();
    file
}

fn truth(stream: &mut UnixStream) -> Maps {
    call(stream, &Request::Get(Item::Truth)).unwrap().1
}

/// Returns the depth at the centre of the camera's image.
fn depth(stream: &mut UnixStream) -> f32 {
    truth(stream).maps[0].1[240 * 640 + 320]
}

#[test]
fn stepping_one_device_steps_the_clock_of_both() {
    let pair = Pair::start("stepped");
    let [mut near, mut far] = pair.services();
    assert_eq!(pair.at.each_ref().map(|at| at.seed), [5, 1].map(Some));
    let mut to = |ns| {
        ask(&mut near, Request::Clock(Step::RunUntilNs(ns)));
        [device(&mut near).frames, device(&mut far).frames]
    };
    let mut instrument = pair.instrument(0);
    instrument.order("TRIG:SOUR BUS;:INIT;*TRG").unwrap();
    assert_eq!(to(5_000_000), [0, 0]);
    let mut instrument = pair.instrument(1);
    instrument.order("TRIG:SOUR BUS;:INIT;*TRG").unwrap();
    // The exposures of one device end at 12 ms and every 16 ms after that; the exposures of the
    // other device end 5 ms later.
    assert_eq!(to(16_999_999), [1, 0]);
    assert_eq!(to(17_000_000), [1, 1]);
    assert_eq!(to(92_000_000), [6, 5]);
    assert_eq!(to(97_000_000), [6, 6]);
    let now = [&mut near, &mut far].map(|stream| {
        let about = ask(stream, Request::Get(Item::Clock)).clock.unwrap();
        about.now_ns
    });
    assert_eq!(now, [97_000_000; 2]);
}

#[test]
fn devices_share_one_time_on_the_fast_clock() {
    let pair = Pair::start("fast");
    let [mut near, mut far] = pair.services();
    for number in [0, 1] {
        let mut instrument = pair.instrument(number);
        instrument.order("TRIG:SOUR BUS;:INIT;*TRG").unwrap();
        assert_eq!(instrument.query("*OPC?").unwrap(), "1");
    }
    let frame = |stream: &mut UnixStream, id| ask(stream, Request::TruthOfFrame(id)).frame.unwrap();
    // The second sequence begins when the first sequence's last exposure or last pattern has ended.
    let last = frame(&mut near, 12);
    assert_eq!(last.end_ns, 12 * 16_000_000 + 12_000_000);
    let first = frame(&mut far, 0);
    assert!(
        (last.end_ns..=13 * 16_000_000).contains(&first.start_ns),
        "{first:?}"
    );
    let clocks = [&mut near, &mut far].map(|stream| ask(stream, Request::Get(Item::Clock)).clock);
    assert_eq!(clocks[0], clocks[1]);
}

#[test]
fn moved_object_is_seen_by_both_from_their_places() {
    let pair = Pair::start("fast");
    let [mut near, mut far] = pair.services();
    let rest = depth(&mut near);
    assert!((depth(&mut far) - rest - 200.0).abs() < 1e-2);
    let placed = Request::Place(Placement {
        object: 0,
        position_mm: [0.0, 0.0, 750.0],
        rotation_deg: [0.0; 3],
    });
    ask(&mut far, placed);
    assert!((depth(&mut near) - 750.0).abs() < 1e-2);
    assert!((depth(&mut far) - 950.0).abs() < 1e-2);
    let scene = ask(&mut near, Request::Get(Item::Objects)).scene.unwrap();
    assert_eq!(scene.objects[0].place.position_mm, [0.0, 0.0, 750.0]);
    assert_eq!(scene.rig.position_mm, [0.0; 3]);
    let scene = ask(&mut far, Request::Get(Item::Objects)).scene.unwrap();
    assert_eq!(scene.rig.position_mm, [0.0, 0.0, -200.0]);
    kill_process(Pid::from_child(&pair.child), Signal::TERM).unwrap();
    let Pair { child, base, .. } = &pair;
    let run = base.path().join("run");
    let end = Instant::now() + LONG;
    while run.exists() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(!run.exists(), "{}: nothing is left behind", child.id());
}

#[test]
fn a_station_is_listed_and_checked() {
    let base = tempfile::tempdir().unwrap();
    let file = station(base.path());
    let check = |file: &Path| {
        phasmid()
            .args(["profile", "check"])
            .arg(file)
            .output()
            .unwrap()
    };
    let output = check(&file);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    for word in [
        "pair",
        "wall.toml",
        "near: webcam-grey",
        "[0.0, 0.0, -200.0]",
    ] {
        assert!(text(&output).contains(word), "{word}: {}", text(&output));
    }
    let listed = phasmid().args(["profile", "list"]).output().unwrap();
    assert!(text(&listed).contains("two-pods"), "{}", text(&listed));
    assert_eq!(check(Path::new("two-pods")).status.code(), Some(0));
    // The files that the station names must exist.
    fs::remove_file(base.path().join("wall.toml")).unwrap();
    let output = check(&file);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output).contains("wall.toml"), "{}", text(&output));
}

#[test]
fn tracking_ends_after_its_seconds_and_hints_once_if_no_skin_is_in_sight() {
    let pair = Pair::start("fast");
    let at = |name: &str| pair.base.path().join(name);
    let planned = phasmid()
        .args(["patient", "plan", "p02-man-mean", "--spacing-mm", "20"])
        .arg("--out")
        .arg(at("planning"))
        .output()
        .unwrap();
    assert!(planned.status.success(), "{}", text(&planned));
    let mut track = phasmid();
    track.args(["track", "--timeout", "60", "--station"]);
    track.arg(at("pair.toml")).arg("--run-dir").arg(at("run"));
    track.arg("--planning").arg(at("planning"));
    // A single scan takes longer than this time limit.
    let tracked = track.args(["--seconds", "0.001"]).output().unwrap();
    assert!(tracked.status.success(), "{}", text(&tracked));
    let lines = tracked.stdout.split(|byte| *byte == b'\n');
    // The names, two scans, and nothing after the last newline.
    assert_eq!(lines.count(), 4, "{}", text(&tracked));
    assert_eq!(text(&tracked).matches("no skin in sight").count(), 1);
}
