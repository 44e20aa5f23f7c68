//! `--weighted` as a user runs it: it reduces noise, the stated standard deviations shrink
//! accordingly, and `demo`, `decode` and `scan` give the same result.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn phasmid(arguments: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(arguments)
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {words}");
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Decodes the frames of a folder, with optional arguments.
fn decode(frames: &Path, out: &Path, options: &[&str]) {
    let (manifest, calibration) = (
        frames.join("sequence.toml"),
        frames.join("calibration.toml"),
    );
    let files = [
        "--manifest",
        text(&manifest),
        "--calibration",
        text(&calibration),
    ];
    phasmid(&[&["decode", "--out", text(out)], &files[..], options].concat());
}

/// Returns the values of a float32 array file.
fn read_npy(path: &Path) -> Vec<f32> {
    let bytes = std::fs::read(path).unwrap();
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let (values, _) = bytes[10 + length..].as_chunks();
    values
        .iter()
        .map(|four| f32::from_le_bytes(*four))
        .collect()
}

/// Returns the root mean square of the differences at pixels where both values are known, and the
/// number of such pixels.
fn rms(a: &[f32], b: &[f32]) -> (f64, usize) {
    let both = a.iter().zip(b).map(|(a, b)| f64::from(a - b));
    let known: Vec<f64> = both.filter(|d| d.is_finite()).collect();
    let squares: f64 = known.iter().map(|d| d * d).sum();
    ((squares / known.len() as f64).sqrt(), known.len())
}

fn median(values: &[f32]) -> f64 {
    let mut known: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
    known.sort_by(f32::total_cmp);
    f64::from(known[known.len() / 2])
}

#[test]
fn weighted_phases_are_less_noisy_and_report_it() {
    let root = tempfile::tempdir().unwrap();
    let at = |name: &str| root.path().join(name);
    let demo = |name: &str, options: &[&str]| {
        let out = at(name);
        phasmid(&[&["demo", "--scene", "plane", "--out", text(&out)], options].concat());
    };
    demo("noisy", &[]);
    demo("weighted", &["--weighted"]);
    demo("clean", &["--no-noise"]);
    decode(&at("noisy"), &at("plain-decoded"), &[]);
    decode(&at("noisy"), &at("weighted-decoded"), &["--weighted"]);
    decode(&at("clean"), &at("clean-decoded"), &[]);
    let map = |name: &str, file: &str| read_npy(&at(name).join(file));
    let x = |name: &str| map(name, "projector_x.npy");
    let (clean, plain, weighted) = (
        x("clean-decoded"),
        x("plain-decoded"),
        x("weighted-decoded"),
    );
    let ((before, seen), (after, seen_too)) = (rms(&plain, &clean), rms(&weighted, &clean));
    assert!(seen > 50_000 && seen_too > 50_000, "{seen} {seen_too}");
    // The noise study finds 9 to 10 % on this bench; the tolerances allow for rounding.
    let won = after / before;
    assert!(
        (0.86..0.95).contains(&won),
        "{after} over {before} is {won}"
    );
    let sigma = |name: &str| median(&map(name, "sigma_x.npy"));
    let said = sigma("weighted-decoded") / sigma("plain-decoded");
    assert!((said / won - 1.0).abs() < 0.04, "says {said}, is {won}");
    let cloud = |name: &str| std::fs::read(at(name).join("cloud.ply")).unwrap();
    assert!(
        cloud("weighted") == cloud("weighted-decoded"),
        "demo and decode give the same cloud"
    );
    assert!(cloud("weighted") != cloud("noisy"));
}

/// A served device; dropping this value stops it.
#[cfg(target_os = "linux")]
struct Served(Child);

#[cfg(target_os = "linux")]
impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(target_os = "linux")]
#[test]
fn scan_weighs_as_decode_does() {
    let root = tempfile::tempdir().unwrap();
    let at = |name: &str| root.path().join(name);
    let run = at("run");
    let child = Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(["serve", "--scene", "plane", "--profile", "pmp-bench"])
        .args([
            "--clock",
            "fast",
            "--camera",
            "socket",
            "--run-dir",
            text(&run),
        ])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let _served = Served(child);
    let begin = Instant::now();
    while !run.join("device.json").exists() {
        assert!(begin.elapsed() < Duration::from_secs(60), "no device");
        std::thread::sleep(Duration::from_millis(20));
    }
    let camera = format!("socket:{}", text(&run.join("camera.sock")));
    let (control, scanned) = (run.join("control"), at("scan"));
    phasmid(&[
        "scan",
        "--camera",
        &camera,
        "--control",
        text(&control),
        "--weighted",
        "--out",
        text(&scanned),
    ]);
    decode(&scanned, &at("plain"), &[]);
    decode(&scanned, &at("weighted"), &["--weighted"]);
    let cloud = |name: &str| std::fs::read(at(name).join("cloud.ply")).unwrap();
    assert!(cloud("scan") == cloud("weighted"));
    assert!(cloud("scan") != cloud("plain"));
}
