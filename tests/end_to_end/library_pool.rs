//! Calls of the library within a thread pool of the caller.

use phasmid::calibrate::solve::Choice;
use phasmid::geometry::Board;
use phasmid::patient::phantom::{Patient, Phantom};
use phasmid::profile::RigPlace;
use phasmid::track::Planned;
use phasmid::{
    DecodeOptions, Device, Pod, ScanOptions, Scanner, ServeOptions, TrackOptions, TrackProgress,
};
use std::num::NonZeroUsize;
use std::process::Command;

/// Environment variable that is set in the process that makes the calls.
const ALONE: &str = "PHASMID_TEST_ALONE";

#[test]
fn calls_in_a_pool_of_the_caller_do_not_start_the_global_pool() {
    // Make the calls in a process of their own, because other tests use the global pool.
    if std::env::var_os(ALONE).is_none() {
        let name = "library_pool::calls_in_a_pool_of_the_caller_do_not_start_the_global_pool";
        let mut alone = Command::new(std::env::current_exe().unwrap());
        let output = alone.args(["--exact", name]).env(ALONE, "1").output();
        let output = output.unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(
            output.status.success() && text.contains("1 passed"),
            "{text}"
        );
        return;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2);
    pool.build().unwrap().install(calls);
    // Fails if the global pool has already been started.
    let global = rayon::ThreadPoolBuilder::new().build_global();
    global.expect("the global pool was started");
}

fn calls() {
    let device = Device::builder().profile("webcam-grey").scene("sphere");
    let mut device = device.build().unwrap();
    let capture = device.scan("quick-4").unwrap();
    let rig = device.factory_calibration().unwrap();
    let decoding = phasmid::decode(&capture, &rig, &DecodeOptions::default()).unwrap();
    let truth = device.truth().unwrap();
    let score = phasmid::compare(&decoding, &truth, &device.rig()).unwrap();
    assert!(score.points > 10_000, "{}", score.points);
    // Without a board.
    let calibrated = phasmid::calibrate(&[capture], &Board::DOTS, Choice::default());
    assert_eq!(calibrated.unwrap_err().exit_code(), 2);

    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("planning");
    let patient = Phantom::new(&Patient::load("p02-man-mean").unwrap());
    let written = patient.export_planning(&folder, 20.0, false, false);
    written.unwrap();
    let planned = Planned::load(&folder).unwrap();
    let serving = device.serve(&ServeOptions {
        threads: NonZeroUsize::new(1),
        ..ServeOptions::default()
    });
    let serving = serving.unwrap();
    let at = serving.endpoints();
    let scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default()).unwrap();
    let mut pods = [Pod::new("pod", scanner, RigPlace::default())];
    let options = TrackOptions {
        scans: Some(2),
        ..TrackOptions::default()
    };
    let mut scans = 0;
    let tracked = phasmid::track(&mut pods, &planned, &options, |progress| {
        scans += usize::from(matches!(progress, TrackProgress::Scan(_)));
    });
    tracked.unwrap();
    assert_eq!(scans, 2);
}
