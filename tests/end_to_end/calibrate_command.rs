//! `phasmid calibrate` as a user runs it: with an emulated device over its ports, and with captures
//! in folders.
#![cfg(target_os = "linux")]

use phasmid::geometry::Rig;
use phasmid::profile::Profile;
use serde_json::Value;
use std::fs;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::{TempDir, tempdir};

fn calibrate(out: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .arg("calibrate")
        .args(arguments)
        .arg("--out")
        .arg(out)
        .output()
        .unwrap()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs the command, which must succeed, and returns the figures that it prints.
fn figures(out: &Path, arguments: &[&str]) -> Value {
    let output = calibrate(out, &[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", words(&output));
    assert!(
        output.stderr.is_empty(),
        "no progress in a pipe: {}",
        words(&output)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Requires that the command is rejected as a user's mistake, in one line that contains the words
/// `needles`.
fn refused(out: &Path, arguments: &[&str], needles: &[&str]) {
    let output = calibrate(out, arguments);
    let words = words(&output);
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert_eq!(words.trim().lines().count(), 1, "{words}");
    for needle in needles {
        assert!(words.contains(needle), "{needle} in {words}");
    }
}

/// Returns a calibration of webcam-grey with its captures, which is computed once.
fn calibrated() -> &'static (TempDir, Value) {
    static MADE: OnceLock<(TempDir, Value)> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = tempdir().unwrap();
        let arguments = [
            "--profile",
            "webcam-grey",
            "--poses",
            "8",
            "--keep-captures",
        ];
        let figures = figures(&folder.path().join("out"), &arguments);
        (folder, figures)
    })
}

fn out() -> PathBuf {
    calibrated().0.path().join("out")
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        match entry.path().is_dir() {
            true => copy(&entry.path(), &target),
            false => drop(fs::copy(entry.path(), target).unwrap()),
        }
    }
}

/// Changes all images of a pose.
fn change(pose: &Path, change: impl Fn(image::GrayImage) -> image::GrayImage) {
    for entry in fs::read_dir(pose).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "png") {
            let picture = image::open(&path).unwrap().into_luma8();
            change(picture).save(&path).unwrap();
        }
    }
}

#[test]
fn an_emulated_device_is_calibrated_over_its_ports() {
    let figures = &calibrated().1;
    let number = |path: &str| {
        let value = figures.pointer(path).and_then(Value::as_f64);
        value.unwrap_or_else(|| panic!("no {path} in {figures}"))
    };
    assert_eq!(figures["poses"], 8, "{figures}");
    assert!(number("/camera/mean_px") < 0.1, "{figures}");
    assert!(number("/projector/mean_px") < 0.3, "{figures}");
    assert!(
        (number("/baseline_mm") / 200.0 - 1.0).abs() < 0.02,
        "{figures}"
    );
    assert!(number("/truth/mahalanobis_squared") > 0.0);
    assert_eq!(figures["truth"]["within_bound"], true, "{figures}");
    for file in [
        "report.html",
        "points.csv",
        "poses.csv",
        "parameters.csv",
        "covariance.csv",
        "calibration.toml",
        "calibration.yml",
        "calibration.xml",
        "summary.json",
        "truth.json",
        "found_pose_00.png",
        "found_pose_07.png",
        "captures/pose_07/frame_22.png",
        "captures/pose_07/sequence.toml",
    ] {
        assert!(out().join(file).is_file(), "{file}");
    }
    let rig = Rig::read(&out().join("calibration.toml")).unwrap();
    let truth = Profile::load("webcam-grey").unwrap().nominal_rig();
    let off = rig.camera.lens.focal_px / truth.camera.lens.focal_px - 1.0;
    assert!(off.abs().max_element() < 0.02, "{off}");
    assert_eq!(rig.noise, truth.noise);
    let truth: Value =
        serde_json::from_str(&fs::read_to_string(out().join("truth.json")).unwrap()).unwrap();
    assert_eq!(truth, figures["truth"]);
}

#[test]
fn output_that_cannot_be_made_is_refused_before_the_device_starts() {
    // The kernel does not allow folders to be created here, not even by root.
    let out = Path::new("/proc/phasmid/out");
    let output = Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(["calibrate", "--profile", "webcam-grey", "--out"])
        .arg(out)
        // With this setting the device could not start, so the error must come before the start.
        .env("TMPDIR", "/nonexistent")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", words(&output));
    let named = words(&output).contains("--out /proc/phasmid/out: ");
    assert!(named, "{}", words(&output));
}

#[test]
fn closed_terminal_leaves_nothing() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("out");
    let mut child = Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(["calibrate", "--profile", "webcam-grey", "--poses", "100"])
        .args(["--keep-captures", "--out"])
        .arg(&out)
        .env("TMPDIR", folder.path())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let begin = std::time::Instant::now();
    while !out.exists() {
        assert!(begin.elapsed().as_secs() < 120);
        assert_eq!(child.try_wait().unwrap(), None);
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let pid = rustix::process::Pid::from_child(&child);
    let hang_up = crate::or_term(rustix::process::Signal::HUP);
    rustix::process::kill_process(pid, hang_up).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn its_captures_give_the_same_rig() {
    let again = tempdir().unwrap();
    let captures = out().join("captures");
    let captures = captures.to_str().unwrap();
    figures(again.path(), &["--captures", captures, "--scale", "3"]);
    for file in ["calibration.toml", "points.csv", "covariance.csv"] {
        let [first, second] = [&out(), again.path()].map(|out| fs::read(out.join(file)).unwrap());
        assert!(first == second, "{file}");
    }
    assert!(!again.path().join("truth.json").exists());
    // A wrong board size is detected by comparison with the device's own calibration.
    let scaled = tempdir().unwrap();
    let f = figures(scaled.path(), &["--captures", captures, "--scale", "6"]);
    let warnings = f["warnings"].to_string();
    assert!(
        warnings.contains("baseline") && warnings.contains("2.0"),
        "{warnings}"
    );
}

#[test]
fn unusable_poses_are_named_and_left_out() {
    let folder = tempdir().unwrap();
    let captures = folder.path().join("captures");
    copy(&out().join("captures"), &captures);
    let pose = |i: usize| captures.join(format!("pose_{i:02}"));
    fs::remove_file(pose(1).join("sequence.toml")).unwrap();
    change(&pose(0), |picture| {
        image::imageops::flip_horizontal(&picture)
    });
    fs::write(pose(2).join("frame_05.png"), "no picture").unwrap();
    let blank = |mut picture: image::GrayImage| {
        // Keeps the projector's light but removes the board.
        let mean = picture.iter().map(|&v| u64::from(v)).sum::<u64>() / picture.len() as u64;
        picture.iter_mut().for_each(|v| *v = mean as u8);
        picture
    };
    change(&pose(4), blank);
    // Crops the first pose with a board, so that its image size differs from the size of most
    // images.
    change(&pose(3), |picture| {
        image::imageops::crop_imm(&picture, 0, 0, 640, 479).to_image()
    });
    // Exchanges two frames.
    fs::copy(pose(6).join("frame_02.png"), pose(6).join("kept")).unwrap();
    fs::copy(pose(6).join("frame_03.png"), pose(6).join("frame_02.png")).unwrap();
    fs::rename(pose(6).join("kept"), pose(6).join("frame_03.png")).unwrap();
    fs::write(captures.join("notes.txt"), "not a pose").unwrap();
    let out = folder.path().join("out");
    let arguments = ["--captures", captures.to_str().unwrap(), "--scale", "3"];
    let figures = figures(&out, &arguments);
    assert_eq!(figures["poses"], 2, "{figures}");
    let left_out = figures["left_out"].as_array().unwrap();
    let why = |name: &str| {
        let found = left_out.iter().find(|pose| pose["name"] == name);
        found.unwrap_or_else(|| panic!("no {name} in {figures}"))["why"].to_string()
    };
    assert!(why("pose_01").contains("sequence.toml"), "{figures}");
    assert!(why("pose_00").contains("mirrored"), "{figures}");
    assert!(why("pose_02").contains("frame_05.png"), "{figures}");
    assert!(why("pose_04").contains("no board"), "{figures}");
    assert!(why("pose_03").contains("640 x 479"), "{figures}");
    assert!(why("pose_06").contains("exchanged"), "{figures}");
    assert!(!out.join("found_pose_01.png").exists());
    assert!(
        out.join("found_pose_00.png").exists(),
        "images are saved for poses that could be read"
    );
}

#[test]
fn refuses_captures_that_determine_no_rig_with_numbers() {
    let folder = tempdir().unwrap();
    let (one, target) = (folder.path().join("one"), folder.path().join("out"));
    copy(&out().join("captures/pose_03"), &one.join("only"));
    let captures = one.to_str().unwrap();
    refused(
        &target,
        &["--captures", captures, "--scale", "3"],
        &["too few poses", "1 of 1"],
    );
    let all = out().join("captures");
    let all = all.to_str().unwrap();
    refused(
        &target,
        &[
            "--force",
            "--captures",
            all,
            "--columns",
            "21",
            "--rows",
            "15",
        ],
        &["no board in any of 8 poses", "pose_00: ", "21 x 15"],
    );
    refused(
        &target,
        &["--force", "--captures", all, "--board", "chess"],
        &["no board in any of 8 poses", "9 x 6"],
    );
    assert!(!target.exists(), "a failed calibration leaves no folder");
    // The same pose four times, and poses with all kinds of mistakes.
    let mixed = folder.path().join("mixed");
    for i in 0..4 {
        copy(
            &out().join("captures/pose_03"),
            &mixed.join(format!("p{i}")),
        );
    }
    copy(&out().join("captures/pose_01"), &mixed.join("other"));
    fs::remove_file(mixed.join("other/sequence.toml")).unwrap();
    copy(&out().join("captures/pose_02"), &mixed.join("white"));
    change(&mixed.join("white"), |mut picture| {
        picture.iter_mut().for_each(|v| *v = 255);
        picture
    });
    refused(
        &target,
        &["--captures", mixed.to_str().unwrap(), "--scale", "3"],
        &[
            "face the same way",
            "degrees",
            "2 other poses cannot be used",
            "other: ",
            "sequence.toml",
            "white: ",
            "saturated",
        ],
    );
}

#[test]
fn refuses_bad_arguments_before_writing_anything() {
    let folder = tempdir().unwrap();
    let target = folder.path().join("out");
    let here = folder.path().to_str().unwrap();
    for (arguments, needles) in [
        (
            &["--profile", "nonesuch"][..],
            &["nonesuch", "pmp-bench"][..],
        ),
        (
            &["--profile", "pmp-bench", "--scale", "1"],
            &["dots of 2.5 mm", "3 px or more"],
        ),
        (
            &["--profile", "pmp-bench", "--poses", "0"],
            &["poses: 0", "1 to 500"],
        ),
        (
            &["--profile", "pmp-bench", "--samples", "5"],
            &["1, 4, 16 or 64"],
        ),
        (
            &["--profile", "pmp-bench", "--distance-mm", "nan"],
            &["distance", "NaN"],
        ),
        (
            &["--profile", "pmp-bench", "--max-tilt-deg", "80"],
            &["--max-tilt-deg: 80", "1 to 60"],
        ),
        (
            &["--profile", "pmp-bench", "--max-tilt-deg", "0"],
            &["--max-tilt-deg: 0", "1 to 60"],
        ),
        (
            &["--profile", "pmp-bench", "--columns", "3"],
            &["--columns: 3"],
        ),
        (
            &["--captures", here],
            &["no subfolder", "a subfolder for each pose"],
        ),
        (&["--captures", "/no/such"], &["--captures", "/no/such"]),
        (
            &["--captures", file!()],
            &["--captures", "a file", "a folder"],
        ),
    ] {
        refused(&target, arguments, needles);
        assert!(!target.exists(), "{arguments:?}");
    }
    let unclear = calibrate(&target, &[]);
    assert_eq!(unclear.status.code(), Some(2));
    assert!(words(&unclear).contains("--profile"), "{}", words(&unclear));
    let both = ["--profile", "pmp-bench", "--captures", here];
    assert_eq!(calibrate(&target, &both).status.code(), Some(2));
    let wrong = ["--profile", "pmp-bench", "--camera-distortion", "k7"];
    assert!(words(&calibrate(&target, &wrong)).contains("k1,k2,p1,p2,k3"));
    fs::create_dir(folder.path().join("pose")).unwrap();
    fs::write(folder.path().join("sequence.toml"), "").unwrap();
    refused(&target, &["--captures", here], &["of a single pose"]);
}

#[test]
fn refuses_to_overwrite_files() {
    let folder = tempdir().unwrap();
    let mine = folder.path().join("calibration.toml");
    fs::write(&mine, "mine").unwrap();
    let arguments = ["--profile", "webcam-grey", "--poses", "3"];
    refused(folder.path(), &arguments, &["calibration.toml", "--force"]);
    assert_eq!(fs::read_to_string(&mine).unwrap(), "mine");
    refused(&out(), &arguments, &["an earlier calibration", "--force"]);
}

#[test]
fn results_of_an_earlier_run_are_removed() {
    let folder = tempdir().unwrap();
    let target = folder.path().join("out");
    copy(&out(), &target);
    // Files left by a killed run, and the folder of a run in progress.
    let (draft, locked) = (".phasmid-a1b2c3.partial", ".phasmid-d4e5f6.partial");
    for name in [draft, locked] {
        fs::DirBuilder::new()
            .mode(0o700)
            .create(target.join(name))
            .unwrap();
        fs::write(target.join(name).join("found_pose_00.png"), "").unwrap();
    }
    let lock = fs::File::open(target.join(locked)).unwrap();
    lock.lock().unwrap();
    fs::write(target.join("notes.txt"), "mine").unwrap();
    fs::write(target.join("found_mine.png"), "mine").unwrap();
    for captures in [target.join("captures"), out().join("captures")] {
        let captures = captures.to_str().unwrap();
        figures(
            &target,
            &["--force", "--captures", captures, "--scale", "3"],
        );
    }
    for gone in ["truth.json", draft] {
        assert!(!target.join(gone).exists(), "{gone}");
    }
    // Existing captures may be a user's own, so only new captures replace them.
    assert!(target.join("captures/pose_07/sequence.toml").is_file());
    assert!(target.join("found_mine.png").is_file());
    assert!(target.join(locked).join("found_pose_00.png").is_file());
    assert!(target.join("found_pose_07.png").is_file());
    assert!(target.join("notes.txt").is_file());
}

/// Only a calibration that succeeds replaces captures, and it replaces only captures of the same
/// poses.
#[test]
fn captures_are_replaced_by_a_calibration_that_succeeds() {
    let folder = tempdir().unwrap();
    let target = folder.path().join("out");
    let pose = |index: usize| target.join(format!("captures/pose_{index:02}"));
    let run = |poses: &str, more: &[&str]| {
        let arguments = [
            "--profile",
            "webcam-grey",
            "--board",
            "chess",
            "--poses",
            poses,
        ];
        let arguments = [&arguments[..], &["--keep-captures", "--force"], more].concat();
        calibrate(&target, &arguments)
    };
    assert!(run("4", &[]).status.success());
    let taken = |index: usize| fs::read(pose(index).join("frame_00.png")).unwrap();
    let before = [taken(0), taken(3)];
    // A calibration with fewer poses would leave the last old capture among the new ones.
    let fewer = run("3", &[]);
    assert_eq!(fewer.status.code(), Some(2));
    assert!(words(&fewer).contains("pose_03"), "{}", words(&fewer));
    // A calibration that fails replaces nothing.
    let fails = run(
        "4",
        &[
            "--camera-distortion",
            "all",
            "--seed",
            "5",
            "--distance-mm",
            "9000",
        ],
    );
    assert!(!fails.status.success());
    assert_eq!([taken(0), taken(3)], before);
    fs::write(pose(0).join("notes.txt"), "mine").unwrap();
    assert!(run("4", &["--seed", "5"]).status.success());
    assert_ne!(taken(0), before[0]);
    assert!(pose(0).join("notes.txt").is_file());
}

/// Calibrates each built-in device with 12 poses of each seed, with two calibrations at a time.
fn calibrate_seeds(boards: &[&str], seeds: std::ops::Range<u64>) {
    let folder = tempdir().unwrap();
    let names: Vec<&str> = phasmid::profile::profile_names().collect();
    let cases: Vec<(&str, &str, u64)> = names
        .iter()
        .flat_map(|name| boards.iter().map(move |board| (*name, *board)))
        .flat_map(|(name, board)| seeds.clone().map(move |seed| (name, board, seed)))
        .collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
    let refused: Vec<String> = pool.unwrap().install(|| {
        use rayon::prelude::*;
        cases
            .par_iter()
            .filter_map(|(name, board, seed)| {
                let out = folder.path().join(format!("{name}-{board}-{seed}"));
                let seed = seed.to_string();
                let output = calibrate(
                    &out,
                    &[
                        "--profile",
                        name,
                        "--board",
                        board,
                        "--poses",
                        "12",
                        "--seed",
                        &seed,
                    ],
                );
                let said = String::from_utf8_lossy(&output.stdout).into_owned();
                let all = output.status.success() && said.contains("12 used, 0 left out");
                (!all).then(|| format!("{name} {board} seed {seed}: {}{said}", words(&output)))
            })
            .collect()
    });
    assert!(refused.is_empty(), "{}", refused.join("\n"));
}

#[test]
fn no_device_before_a_chessboard_is_refused() {
    calibrate_seeds(&["chess"], 0..1);
}

#[test]
#[ignore = "two hundred calibrations: twenty minutes"]
fn no_seed_of_either_board_is_refused() {
    calibrate_seeds(&["chess", "dots"], 0..20);
}
