//! Dialects over a real pty, with host and device in separate processes.

use crate::served::{Served, phasmid, serve, text};
use phasmid::host::{CommandPort, SerialPort};
use phasmid::protocol::service::ClockPace;
use std::fs;
use std::path::Path;
use std::process::Output;
use std::time::{Duration, Instant};

const WEBCAM: &str = include_str!("../../../device-profiles/webcam-grey.toml");
const DLP: &str = include_str!("../../../device-profiles/dlp-evm.toml");

/// Writes a profile for these tests with this `[control]` table, and returns its path.
fn profile(folder: &Path, control: &str) -> String {
    let path = folder.join("mine.toml");
    fs::write(&path, format!("{WEBCAM}\n[control]\n{control}\n")).unwrap();
    path.to_str().unwrap().to_owned()
}

fn check(file: &str) -> Output {
    phasmid().args(["profile", "check", file]).output().unwrap()
}

/// A scan uses the dialect in `device.json`, in real time and on the fast clock, even while the
/// device still sends its power-on messages.
#[test]
fn scan_uses_the_dialect_of_the_device_file() {
    for dialect in ["okline", "dlpc350"] {
        let served = Served::spawn_as_it_is(serve().args(["--dialect", dialect]));
        assert_eq!(served.at.dialect.as_deref(), Some(dialect));
        assert_eq!(served.at.clock, Some(ClockPace::Real));
        assert_eq!(served.at.baud, None);
        let out = served.dir.parent().unwrap().join("out");
        let scan = served.scan(&out, &["--no-decode", "--json"]);
        assert_eq!(scan.status.code(), Some(0), "{dialect}: {}", text(&scan));
        let said = String::from_utf8_lossy(&scan.stderr);
        assert!(!said.contains("scanning again"), "{dialect}: {said}");
        let summary: serde_json::Value = serde_json::from_slice(&scan.stdout).unwrap();
        assert_eq!(summary["frames"], 13, "{dialect}");
        // Options on the command line take precedence. The error for a device that does not answer
        // says that it may use another dialect.
        let more = [
            "--no-decode",
            "--force",
            "--timeout",
            "0.3",
            "--dialect",
            "scpi",
        ];
        let deaf = served.scan(&out, &more);
        assert_eq!(deaf.status.code(), Some(1), "{dialect}: {}", text(&deaf));
        assert!(
            text(&deaf).contains("--dialect"),
            "{dialect}: {}",
            text(&deaf)
        );
        served.stop(rustix::process::Signal::TERM);
    }
}

/// A scan works with the guide's example dialect from a file; what the device cannot report is read
/// from files as well.
#[test]
fn scan_works_with_a_custom_dialect() {
    let base = tempfile::tempdir().unwrap();
    let guide = include_str!("../../../src/protocol/dialect/guide.md");
    let (_, rest) = guide.split_once("```toml dialect\n").unwrap();
    let file = base.path().join("gspark.toml");
    fs::write(&file, rest.split_once("```").unwrap().0).unwrap();
    let plain = base.path().join("plain");
    let served = Served::start(&[]);
    assert!(served.scan(&plain, &["--no-decode"]).status.success());
    drop(served);
    let served = Served::start(&["--dialect", file.to_str().unwrap()]);
    assert_eq!(served.at.dialect.as_deref(), file.to_str());
    let out = base.path().join("out");
    let path = |name: &str| plain.join(name).to_str().unwrap().to_owned();
    let (manifest, calibration) = (path("sequence.toml"), path("calibration.toml"));
    let more = [
        "--manifest",
        &manifest,
        "--calibration",
        &calibration,
        "--json",
    ];
    let scan = served.scan(&out, &more);
    assert_eq!(scan.status.code(), Some(0), "{}", text(&scan));
    for frame in 0..13 {
        let name = format!("frame_{frame:02}.png");
        let [one, other] = [&plain, &out].map(|dir| fs::read(dir.join(&name)).unwrap());
        assert!(one == other, "{name} differs");
    }
    served.stop(rustix::process::Signal::TERM);
}

/// At 9600 baud, a long query and a long answer each take at least the transmission time of their
/// bytes.
#[test]
fn real_clock_delays_bytes_by_the_baud_rate() {
    let base = tempfile::tempdir().unwrap();
    let file = profile(base.path(), "dialect = \"okline\"\nbaud = 9600");
    let mut command = phasmid();
    command.args(["serve", "--scene", "plane", "--profile", &file]);
    let served = Served::spawn_as_it_is(&mut command);
    assert_eq!(served.at.baud, Some(9600));
    let mut port = SerialPort::open(served.at.control.to_str().unwrap()).unwrap();
    let mut line = |request: &[u8]| {
        let begin = Instant::now();
        port.send(request, Duration::from_secs(5)).unwrap();
        let mut said = Vec::new();
        // The power-on messages may still be arriving.
        let answer = |said: &[u8]| {
            let lines = String::from_utf8_lossy(said).into_owned();
            let mut lines = lines.split_inclusive('\n');
            let whole = lines.find(|line| line.starts_with("ok ") && line.ends_with('\n'));
            whole.map(str::to_owned)
        };
        loop {
            if let Some(line) = answer(&said) {
                return (line, begin.elapsed());
            }
            let mut buffer = [0; 4096];
            let len = port.receive(&mut buffer, Duration::from_secs(20)).unwrap();
            assert!(len > 0, "silence behind \"{}\"", said.escape_ascii());
            said.extend_from_slice(&buffer[..len]);
        }
    };
    assert_eq!(line(b"mark?\n").0, "ok 0\r\n");
    let (said, took) = line(b"manifest 0\n");
    let bytes = said.len();
    assert!(bytes > 500, "{said}");
    let least = Duration::from_secs_f64(10.0 * ("manifest 0\n".len() + bytes) as f64 / 9600.0);
    assert!(
        took >= least,
        "{bytes} bytes in {took:?}, which take {least:?}"
    );
}

/// Host and device both reject an invalid control port and name the line.
#[test]
fn profile_check_judges_a_port_as_serve_does() {
    let base = tempfile::tempdir().unwrap();
    let line = WEBCAM.lines().count() + 3;
    let own = base.path().join("own.toml");
    let okline = phasmid::protocol::dialect::Dialect::text("okline").unwrap();
    fs::write(&own, okline.replace("SEQ:COUN?", "SEQ:MOON?")).unwrap();
    for (control, words) in [
        (
            "dialect = \"nope\"",
            vec![
                format!("mine.toml:{line}: control.dialect"),
                "nope".into(),
                "okline".into(),
            ],
        ),
        (
            "data_bits = 7\ndialect = \"dlpc350\"",
            vec![
                format!("mine.toml:{line}: control.data_bits: 7"),
                "expected 8".into(),
            ],
        ),
        (
            "dialect = \"own.toml\"",
            vec!["own.toml:".into(), "SEQ:MOON?".into()],
        ),
        (
            "dialect = \"mine.toml\"",
            vec![format!("mine.toml:{line}: control.dialect")],
        ),
    ] {
        let file = profile(base.path(), control);
        let checked = check(&file);
        let served = phasmid()
            .args(["serve", "--profile", &file])
            .output()
            .unwrap();
        assert_eq!(
            checked.status.code(),
            Some(2),
            "{control}: {}",
            text(&checked)
        );
        assert_eq!(text(&checked), text(&served), "{control}");
        for word in words {
            assert!(
                text(&checked).contains(&word),
                "{control}: {}",
                text(&checked)
            );
        }
    }
    // The station's setting overrides the setting in its profiles.
    profile(base.path(), "data_bits = 7");
    for (dialect, place) in [
        ("nope", "station.toml:6: device[0].dialect"),
        ("dlpc350", "control.data_bits: 7"),
    ] {
        let station = base.path().join("station.toml");
        let text_of = format!(
            "name = \"s\"\ndescription = \"\"\n[[device]]\nname = \"a\"\nprofile = \"mine.toml\"\n\
             dialect = \"{dialect}\"\n"
        );
        fs::write(&station, text_of).unwrap();
        let station = station.to_str().unwrap();
        let checked = check(station);
        let served = phasmid()
            .args(["serve", "--profile", station])
            .output()
            .unwrap();
        assert_eq!(
            checked.status.code(),
            Some(2),
            "{dialect}: {}",
            text(&checked)
        );
        assert_eq!(text(&checked), text(&served), "{dialect}");
        assert!(
            text(&checked).contains(place),
            "{dialect}: {}",
            text(&checked)
        );
    }
}

#[test]
fn profile_check_lists_what_determines_timing() {
    let base = tempfile::tempdir().unwrap();
    let file = profile(
        base.path(),
        "dialect = \"okline\"\nbaud = 9600\nparity = \"even\"",
    );
    let said = text(&check(&file));
    assert!(
        said.contains("control     okline at 9600 baud, 8E1\n"),
        "{said}"
    );
    let light =
        "[projector.led]\nrise_us = 5.0\ndroop = [{ time_constant_s = 9.0, fraction = 0.1 }]\n";
    let file = base.path().join("led.toml");
    fs::write(&file, format!("{DLP}\n{light}")).unwrap();
    let said = text(&check(file.to_str().unwrap()));
    for line in [
        "control     scpi on a line without delay",
        "readout     1200 us of a frame",
        "timing      steps of 1 us",
        "light       rises in 5 us, loses 10 %",
    ] {
        assert!(said.contains(line), "{line}: {said}");
    }
}
