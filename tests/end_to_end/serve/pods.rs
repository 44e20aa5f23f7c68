//! The pods of a treatment room, used over their ports: locating the pods, and tracking a patient.

use crate::served::{phasmid, text};
use phasmid::geometry::Pose;
use phasmid::profile::{Configuration, Profile, Station};
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PODS: [&str; 3] = ["left", "right", "foot"];
/// Time limit for waits. Three pods that render a moving patient take 4 s per scan on two idle
/// cores.
const HANG: Duration = Duration::from_secs(900);

/// The pods of a station in front of a scene; dropping this value stops them.
struct Room {
    child: Child,
    run: PathBuf,
    base: tempfile::TempDir,
}

impl Room {
    fn serve(station: &str, scene: &str) -> Self {
        let base = tempfile::tempdir().unwrap();
        let run = base.path().join("run");
        let mut child = phasmid()
            .args(["serve", "--clock", "fast", "--exact-calibration"])
            .args(["--profile", station, "--scene", scene, "--run-dir"])
            .arg(&run)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let end = Instant::now() + HANG;
        while !PODS
            .iter()
            .all(|pod| run.join(pod).join("device.json").exists())
        {
            assert!(Instant::now() < end, "the pods do not start");
            assert!(child.try_wait().unwrap().is_none(), "the server has ended");
            std::thread::sleep(Duration::from_millis(5));
        }
        Self { child, run, base }
    }

    fn place(&self, name: &str) -> PathBuf {
        self.base.path().join(name)
    }

    /// Returns a command with the addresses of all pods.
    fn command(&self, name: &str) -> Command {
        let mut command = phasmid();
        command
            .args([name, "--timeout", "60", "--run-dir"])
            .arg(&self.run);
        command
    }
}

impl Drop for Room {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn station(name: &str) -> Station {
    match Configuration::load(name).unwrap() {
        Configuration::Station(station) => station,
        Configuration::Device(_) => panic!("{name} is a device"),
    }
}

/// Returns the pose of each pod.
fn places(station: &Station) -> Vec<Pose> {
    let rigs = station.device.iter().map(|device| device.rig().unwrap());
    let place =
        |rig: phasmid::profile::RigPlace| Pose::from_xyz_deg(rig.position_mm, rig.rotation_deg);
    rigs.map(place).collect()
}

fn succeeded(output: &Output) -> String {
    assert!(output.status.success(), "{}", text(output));
    text(output)
}

fn refused(command: &mut Command, words: &[&str]) {
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    for word in words {
        assert!(text(&output).contains(word), "{word}: {}", text(&output));
    }
}

#[test]
fn pod_that_was_moved_is_located_again() {
    let folder = tempfile::tempdir().unwrap();
    let planned = include_str!("../../../device-profiles/stations/sgrt-ceiling.toml");
    let knocked = planned
        .replace("[-1500.0, -700.0, 1700.0]", "[-1501.2, -699.1, 1700.7]")
        .replace("[-135.7634, 0.0, -64.9831]", "[-135.7034, 0.05, -64.9331]");
    assert_ne!(planned, knocked);
    let file = folder.path().join("knocked.toml");
    fs::write(&file, knocked).unwrap();
    let file = file.to_str().unwrap();
    let room = Room::serve(file, "treatment-room-board");

    let out = room.place("found.toml");
    let said = room
        .command("locate")
        .arg("--json")
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    let said: serde_json::Value = serde_json::from_str(&succeeded(&said)).unwrap();
    let found = station(out.to_str().unwrap());
    assert_eq!(found.scene().as_deref(), Some("treatment-room"));
    for (place, truth) in places(&found).iter().zip(&places(&station(file))) {
        // The located pose must map the isocentre to the right position and preserve directions.
        let off = *place * truth.inverse();
        assert!(off.translation_mm.length() < 0.01, "{off:?}");
        let turned = off.rotation - glam::DMat3::IDENTITY;
        assert!(
            turned.to_cols_array().iter().all(|x| x.abs() < 1e-5),
            "{off:?}"
        );
    }
    for (number, pod) in PODS.iter().enumerate() {
        let one = &said[number];
        assert_eq!(one["name"], *pod);
        let value = |name: &str| one[name].as_f64().unwrap();
        let was_off = value("off_mm");
        assert_eq!(was_off > 1.0, *pod == "left", "{pod}: {was_off}");
        assert!(value("deviation_mm") < 0.01 && value("deviation_mm") > 0.0);
        assert!(one["projector"]["points"].as_u64().unwrap() > 300);
        let whitened = one["camera"]["whitened_rms"].as_f64().unwrap();
        assert!((0.7..1.4).contains(&whitened), "{whitened}");
    }

    // The pods show the same patterns again.
    let scanned = phasmid()
        .args(["scan", "--no-decode", "--timeout", "60", "--control"])
        .arg(room.run.join("left/control"))
        .args([
            "--camera",
            &format!("socket:{}", room.run.join("left/camera.sock").display()),
        ])
        .arg("--out")
        .arg(room.place("scan"))
        .output()
        .unwrap();
    succeeded(&scanned);
    let manifest = fs::read_to_string(room.place("scan").join("sequence.toml")).unwrap();
    assert_eq!(manifest.matches("[[frame]]").count(), 9, "{manifest}");

    // A calibration of a rig with another baseline is detected.
    let calibration = fs::read_to_string(room.place("scan").join("calibration.toml")).unwrap();
    let grown = calibration.replace("550.0", "551.0");
    assert_ne!(calibration, grown);
    let wrong = room.place("wrong.toml");
    fs::write(&wrong, grown).unwrap();
    let option = format!("left={}", wrong.display());
    let warned = room
        .command("locate")
        .args(["--calibration", &option, "--out"])
        .arg(room.place("warned.toml"))
        .output()
        .unwrap();
    let warned = succeeded(&warned);
    assert!(
        warned.contains("left: the residuals of the board's points are "),
        "{warned}"
    );
    assert!(!warned.contains("right: the residuals"), "{warned}");

    let mut again = room.command("locate");
    refused(
        again.arg("--out").arg(&out),
        &["found.toml: an existing file"],
    );
    let new = room.place("new.toml");
    let with = |option: &str, value: &str, words: &[&str]| {
        let mut command = room.command("locate");
        refused(command.arg("--out").arg(&new).args([option, value]), words);
        assert!(!new.exists());
    };
    with(
        "--calibration",
        &format!("up={}", wrong.display()),
        &["\"up\"", "left, right, foot"],
    );
    with(
        "--calibration",
        "left",
        &["no calibration; expected NAME=FILE"],
    );
    with(
        "--board-position",
        "0,0",
        &["--board-position 0,0: not three numbers"],
    );
    with(
        "--sequence",
        "none",
        &["left: ", "--sequence none", "pod-3, pod-3-xy"],
    );
    let ports = format!(
        "socket:{0}/left/camera.sock,{0}/left/control",
        room.run.display()
    );
    let mut one_twice = phasmid();
    let (left, right) = (format!("left={ports}"), format!("right={ports}"));
    one_twice.args(["locate", "--device", &left, "--device", &right, "--out"]);
    refused(
        one_twice.arg(&new),
        &["--device: left and right use the same port; expected separate ports"],
    );
    // One pod appears under another pod's name, and the board is at another position.
    let mut other = phasmid();
    other.args(["locate", "--timeout", "60", "--device", &right, "--out"]);
    let far = succeeded(&other.arg(room.place("other.toml")).output().unwrap());
    assert!(
        far.contains("right: more than 50 mm or 5 degrees from the pose"),
        "{far}"
    );
    // A board whose size differs slightly from the stated one.
    let mut nearly = room.command("locate");
    nearly.args(["--scale", "4.99", "--out"]);
    let nearly = succeeded(&nearly.arg(room.place("nearly.toml")).output().unwrap());
    assert!(
        nearly.contains("the board does not have the given size, or is not flat"),
        "{nearly}"
    );

    // A board whose size differs from the stated one.
    let mut command = room.command("locate");
    let output = command
        .arg("--out")
        .arg(&new)
        .args(["--scale", "4"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    assert!(text(&output).contains("left: "), "{}", text(&output));
    assert!(
        text(&output).contains("a board of the specified size"),
        "{}",
        text(&output)
    );
}

/// Returns the complete lines of a file except the first line.
fn lines(path: &Path) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap_or_default();
    let whole = text
        .split_inclusive('\n')
        .filter(|line| line.ends_with('\n'));
    whole.skip(1).map(str::to_owned).collect()
}

/// Writes a station file like `sgrt-ceiling` to `folder`, with pods whose images are cropped to the
/// central quarter: the surface has the same resolution in half the time.
fn cropped_pods(folder: &Path) -> PathBuf {
    let pod = include_str!("../../../device-profiles/sgrt-pod.toml")
        .replace("width_px = 640 ", "width_px = 320 ")
        .replace("height_px = 480\n", "height_px = 240\n")
        .replace("sensor_width_mm = 4.96 ", "sensor_width_mm = 2.48 ");
    fs::write(folder.join("pod.toml"), pod).unwrap();
    let station = include_str!("../../../device-profiles/stations/sgrt-ceiling.toml")
        .replace("\"sgrt-pod\"", "\"pod.toml\"");
    let path = folder.join("cropped.toml");
    fs::write(&path, station).unwrap();
    let cropped = self::station(path.to_str().unwrap());
    for device in &cropped.device {
        let camera = Profile::load(&cropped.profile(device)).unwrap().camera;
        assert_eq!([camera.width_px, camera.height_px], [320, 240]);
    }
    path
}

#[test]
fn a_patient_is_followed_and_a_silent_device_holds_the_beam() {
    let folder = tempfile::tempdir().unwrap();
    let station = cropped_pods(folder.path());
    let room = Room::serve(station.to_str().unwrap(), "treatment-room");
    let planning = room.place("planning");
    let planned = phasmid()
        .args([
            "patient",
            "plan",
            "p02-man-mean",
            "--spacing-mm",
            "12",
            "--out",
        ])
        .arg(&planning)
        .output()
        .unwrap();
    succeeded(&planned);

    let twice = format!(
        "left=socket:{0}/left/camera.sock,{0}/left/control",
        room.run.display()
    );
    let mut command = phasmid();
    command.arg("track").arg("--planning").arg(&planning);
    refused(
        command.args(["--device", &twice, "--device", &twice]),
        &["--device: \"left\" twice; expected each pod once"],
    );
    let mut command = phasmid();
    command.arg("track").arg("--planning").arg(&planning);
    refused(
        command.args(["--device", &twice.replacen("left", "up", 1)]),
        &["\"up\", which sgrt-ceiling does not have; expected left, right, foot"],
    );

    let out = room.place("track.csv");
    let mut track = room
        .command("track")
        .arg("--planning")
        .arg(&planning)
        .arg("--out")
        .arg(&out)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let end = Instant::now() + HANG;
    while lines(&out).len() < 3 {
        assert!(Instant::now() < end, "no lines");
        assert!(track.try_wait().unwrap().is_none(), "the command has ended");
        std::thread::sleep(Duration::from_millis(20));
    }
    let server = Pid::from_child(&room.child);
    kill_process(server, Signal::STOP).unwrap();
    // Data that has already arrived is processed; then no more arrives.
    let held = |lines: &[String]| {
        let last = lines.last().is_some_and(|line| line.contains(",held,"));
        last && lines.last().unwrap().split(',').nth(4) == Some("")
    };
    while !held(&lines(&out)) {
        assert!(
            Instant::now() < end,
            "no line that reports missing scans: {:?}",
            lines(&out)
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    kill_process(server, Signal::CONT).unwrap();
    let count = lines(&out).len();
    while lines(&out).len() < count + 2 {
        assert!(Instant::now() < end, "no lines after the server continues");
        std::thread::sleep(Duration::from_millis(20));
    }
    kill_process(Pid::from_child(&track), crate::interrupt()).unwrap();
    assert!(track.wait().unwrap().success());

    let text = fs::read_to_string(&out).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let column = |name: &str| names.iter().position(|n| *n == name).unwrap();
    for line in lines(&out) {
        let fields: Vec<&str> = line.trim_end().split(',').collect();
        assert!(fields.len() >= names.len(), "{line}");
        // A line that was written while no data arrived has no points.
        if fields[column("points")].is_empty() {
            continue;
        }
        let number = |name: &str| fields[column(name)].parse::<f64>().unwrap();
        assert!(number("points") > 3000.0, "{line}");
        assert!(
            number("tumour_off_mm") < 40.0 && number("coverage") > 0.5,
            "{line}"
        );
        assert!(number("since_motion_ms") > number("host_ms"), "{line}");
    }
}
