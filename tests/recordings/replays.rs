//! Scans of replays, and clients that depart from the recording.

use crate::alone;
use crate::served::{Served, phasmid, serve, text};
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Returns the command `phasmid replay` for a file.
pub(crate) fn replay(file: &Path, args: &[&str]) -> Command {
    let mut command = phasmid();
    command.arg("replay").arg(file).args(args);
    command
}

/// Asks a process to end; returns its status and its output.
pub(crate) fn stop(mut served: Served) -> (Option<i32>, String) {
    kill_process(Pid::from_child(&served.child), Signal::TERM).unwrap();
    let status = served.child.wait().unwrap();
    let mut words = String::new();
    if let Some(mut stderr) = served.child.stderr.take() {
        stderr.read_to_string(&mut words).unwrap();
    }
    assert!(!served.dir.exists(), "nothing is left behind");
    (status.code(), words)
}

/// Requires the files of two folders to be byte-identical.
pub(crate) fn assert_same(one: &Path, other: &Path) {
    let names = |folder: &Path| {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names(one), names(other));
    for name in names(one) {
        let same = fs::read(one.join(&name)).unwrap() == fs::read(other.join(&name)).unwrap();
        assert!(same, "{name:?}");
    }
    assert!(one.join("cloud.ply").exists() && one.join("frame_12.png").exists());
}

#[test]
fn a_scan_of_a_replay_is_the_scan_that_was_recorded() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let at = |name: &str| base.path().join(name);
    let (device, host) = (at("device.rec"), at("host.rec"));
    let served = Served::start(&["--seed", "5", "--record", device.to_str().unwrap()]);
    let scan = served.scan(&at("scan"), &["--record", host.to_str().unwrap()]);
    assert!(scan.status.success(), "{}", text(&scan));
    served.stop(Signal::TERM);
    for (file, clock) in [(&device, "fast"), (&host, "fast"), (&device, "real")] {
        let mut command = replay(file, &["--clock", clock]);
        let replayed = Served::spawn_as_it_is(command.stderr(Stdio::piped()));
        // The host does not know the scene in front of the device.
        let known = (replayed.at.seed, replayed.at.scene.as_deref());
        let want = match file == &device {
            true => (Some(5), Some("plane")),
            false => (None, None),
        };
        assert_eq!(known, want);
        let out = at("again");
        let scan = replayed.scan(&out, &["--force"]);
        assert!(scan.status.success(), "{clock} {}", text(&scan));
        assert_same(&at("scan"), &out);
        let words = (Some(0), String::new());
        assert_eq!(stop(replayed), words, "{clock} {}", file.display());
    }
    // A recording of a scan of a replay has the same content.
    let info = |file: &Path| {
        let info = phasmid()
            .args(["record", "info", "--json"])
            .arg(file)
            .output();
        let info = info.unwrap();
        assert!(info.status.success(), "{}", text(&info));
        serde_json::from_slice::<serde_json::Value>(&info.stdout).unwrap()
    };
    let (device, host) = (info(&device), info(&host));
    for part in ["frame", "frames", "clients", "lines_sent"] {
        assert_eq!(device[part], host[part], "{part}");
    }
    assert_eq!(device["frame"]["count"], 13);
    assert_eq!(device["sent"]["bytes"], host["sent"]["bytes"]);
    assert_eq!(device["ending"]["how"], "proper");
    assert_eq!(host["about"]["side"], "host");
}

/// Sends a query to the port and returns the reply line.
fn ask(port: &mut BufReader<fs::File>, question: &str) -> String {
    port.get_mut().write_all(question.as_bytes()).unwrap();
    let mut answer = String::new();
    port.read_line(&mut answer).unwrap();
    answer
}

fn open(served: &Served) -> BufReader<fs::File> {
    let mut options = fs::File::options();
    BufReader::new(
        options
            .read(true)
            .write(true)
            .open(&served.at.control)
            .unwrap(),
    )
}

/// Waits until a recording contains this number of bytes that the device has sent.
fn wait_for(file: &Path, received: u64) {
    let end = Instant::now() + Duration::from_secs(60);
    loop {
        let info = phasmid()
            .args(["record", "info", "--json"])
            .arg(file)
            .output();
        let info: serde_json::Value = serde_json::from_slice(&info.unwrap().stdout).unwrap();
        if info["received"]["bytes"].as_u64().unwrap() >= received {
            return;
        }
        assert!(Instant::now() < end, "{info}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn departure_is_located_and_killed_recorder_lost_nothing() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let file = base.path().join("killed.rec");
    let mut served = Served::start(&["--record", file.to_str().unwrap()]);
    let mut port = open(&served);
    let name = ask(&mut port, "*IDN?\n");
    assert_eq!(ask(&mut port, "CAM:GAIN?\n"), "0\n");
    drop(port);
    let mut port = open(&served);
    assert_eq!(ask(&mut port, "*TST?\n"), "0\n");
    wait_for(&file, (name.len() + 4) as u64);
    served.child.kill().unwrap();
    served.child.wait().unwrap();
    drop(served);
    let info = phasmid()
        .args(["record", "info"])
        .arg(&file)
        .output()
        .unwrap();
    assert!(info.status.success());
    for needle in [
        "its writer was killed",
        "2 of the port",
        "22 bytes, 3 lines",
    ] {
        assert!(text(&info).contains(needle), "{}", text(&info));
    }

    let mut command = replay(&file, &["--clock", "fast", "--tcp"]);
    let mut replayed = Served::spawn_as_it_is(command.stderr(Stdio::piped()));
    assert!(replayed.at.camera_tcp.is_some());
    let mut port = open(&replayed);
    assert_eq!(ask(&mut port, "*IDN?\n"), name);
    port.get_mut().write_all(b"CAM:EXP?\n").unwrap();
    // The client disconnects only after its departure has been reported, because unread data is lost
    // when its writer disconnects.
    let mut stderr = BufReader::new(replayed.child.stderr.take().unwrap());
    let mut told = String::new();
    stderr.read_line(&mut told).unwrap();
    drop(port);
    // The next client gets only its own answers, since the port has discarded the previous client's
    // query.
    let mut port = open(&replayed);
    assert_eq!(ask(&mut port, "*TST?\n"), "0\n");
    drop(port);
    let (status, _) = stop(replayed);
    let mut words = told;
    stderr.read_to_string(&mut words).unwrap();
    assert_eq!(status, Some(1), "{words}");
    let expected = "expected \"CAM:GAIN?\\n\", but \"CAM:EXP?\\n\", different from byte 4 on";
    assert_eq!(words.matches(expected).count(), 1, "{words}");
    let end = "1 client has left the recorded path; 16 of the 22 bytes";
    assert!(words.contains(end), "{words}");

    // A client that follows only half of the recording has not replayed it completely.
    let mut command = replay(&file, &["--clock", "fast"]);
    let replayed = Served::spawn_as_it_is(command.stderr(Stdio::piped()));
    assert_eq!(ask(&mut open(&replayed), "*IDN?\n"), name);
    let (status, words) = stop(replayed);
    assert_eq!(status, Some(1), "{words}");
}

/// A scan during which the port fails, at any of its messages, is replayed from either side.
#[test]
fn a_scan_during_which_the_port_went_is_replayed_from_either_side() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let at = |name: &str| base.path().join(name);
    fs::write(
        at("bad.toml"),
        "[[fault]]\nwhat = \"disconnect\"\nfor_ms = 150\nwhen = { nth = 9 }\n",
    )
    .unwrap();
    let (device, host) = (at("device.rec"), at("host.rec"));
    for dialect in ["scpi", "dlpc350"] {
        let mut command = serve();
        command.args([
            "--clock",
            "real",
            "--camera",
            "socket",
            "--dialect",
            dialect,
        ]);
        command.args(["--force", "--record"]).arg(&device);
        let served = Served::spawn_as_it_is(command.arg("--faults").arg(at("bad.toml")));
        let options = ["--force", "--dialect", dialect, "--record"];
        let options = [&options[..], &[host.to_str().unwrap()]].concat();
        let scan = served.scan(&at("scan"), &options);
        assert!(scan.status.success(), "{dialect} {}", text(&scan));
        served.stop(Signal::TERM);
        for (file, clock) in [(&host, "fast"), (&host, "real"), (&device, "fast")] {
            let mut command = replay(file, &["--clock", clock]);
            let replayed = Served::spawn_as_it_is(command.stderr(Stdio::piped()));
            let out = at("again");
            let scan = replayed.scan(&out, &["--force", "--dialect", dialect]);
            let (status, words) = stop(replayed);
            let case = format!("{dialect} {clock} {}", file.display());
            assert!(scan.status.success(), "{case} {words} {}", text(&scan));
            assert_same(&at("scan"), &out);
            assert_eq!((status, words), (Some(0), String::new()), "{case}");
        }
    }
}

/// If a device was killed during a scan, port and camera disappear at the same time, in the replay
/// as well. A client that scans this replay therefore does not depart from the recording.
#[test]
fn a_device_that_was_killed_in_a_scan_is_killed_in_its_replay() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let file = base.path().join("host.rec");
    let mut served = Served::spawn_as_it_is(serve().args(["--clock", "real"]));
    let scan = phasmid()
        .args(["scan", "--camera", &served.at.camera, "--control"])
        .arg(&served.at.control)
        .arg("--out")
        .arg(base.path().join("scan"))
        .arg("--record")
        .arg(&file)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let end = Instant::now() + Duration::from_secs(60);
    let frames = || {
        let info = phasmid()
            .args(["record", "info", "--json"])
            .arg(&file)
            .output();
        let info = serde_json::from_slice::<serde_json::Value>(&info.unwrap().stdout);
        info.map_or(0, |info| info["frame"]["count"].as_u64().unwrap_or(0))
    };
    while frames() < 2 {
        assert!(Instant::now() < end, "no frame comes");
    }
    served.child.kill().unwrap();
    served.child.wait().unwrap();
    let failed = scan.wait_with_output().unwrap();
    assert_eq!(failed.status.code(), Some(1), "{}", text(&failed));
    drop(served);
    let recorded = frames();
    assert!((2..13).contains(&recorded), "{recorded}");

    for clock in ["real", "fast"] {
        let mut command = replay(&file, &["--clock", clock]);
        let replayed = Served::spawn_as_it_is(command.stderr(Stdio::piped()));
        let scan = replayed.scan(&base.path().join(clock), &[]);
        assert_eq!(scan.status.code(), Some(1), "{clock}: {}", text(&scan));
        let words = (Some(0), String::new());
        assert_eq!(stop(replayed), words, "{clock}: {}", text(&scan));
    }
}
