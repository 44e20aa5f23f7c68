//! Calibration files written by OpenCV and SLStudio, and corrupted ones.

use phasmid::calibrate::files::{Sizes, read_rig_sized, rig_from_bytes};
use phasmid::geometry::Rig;
use std::path::{Path, PathBuf};

#[path = "../fuzz/src/calibration.rs"]
mod calibration;

const SIZES: Sizes = Sizes {
    camera: Some([1138, 489]),
    projector: Some([1920, 1080]),
};

/// Bytes that have a meaning in one of the formats.
const SPOIL: &[u8] = b"<>/[]:-.,#%!'\" \n\t0e\xff";

fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/calibrations");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    assert!(files.len() >= 5);
    files
}

/// Returns the largest relative difference between the numbers of two rigs.
fn apart(a: &Rig, b: &Rig) -> f64 {
    let numbers = |rig: &Rig| {
        let views = [rig.camera, rig.projector].into_iter();
        let numbers = views.flat_map(|view| {
            let lens = view.lens;
            let (r, t) = (
                view.rig_from_view.rotation,
                view.rig_from_view.translation_mm,
            );
            let focal = [lens.focal_px.to_array(), lens.principal_px.to_array()].concat();
            [
                focal,
                lens.distortion.to_vec(),
                r.to_cols_array().to_vec(),
                t.to_array().to_vec(),
            ]
            .concat()
        });
        numbers.collect::<Vec<f64>>()
    };
    numbers(a)
        .iter()
        .zip(numbers(b))
        .map(|(a, b)| (a - b).abs() / a.abs().max(b.abs()).max(1.0))
        .fold(0.0, f64::max)
}

#[test]
fn files_of_all_kinds_hold_the_same_rig() {
    let rigs: Vec<(PathBuf, Rig)> = files()
        .into_iter()
        .map(|path| (path.clone(), read_rig_sized(&path, SIZES).unwrap()))
        .collect();
    let (_, first) = &rigs[0];
    assert_eq!(first.camera.lens.focal_px.to_array(), [632.25, 632.3]);
    assert_eq!(
        first.camera.lens.distortion,
        [-0.02, 0.01, 1e-4, -2e-5, 1e-300]
    );
    for (path, rig) in &rigs {
        // SLStudio's text files have six or eight digits.
        let text = path.extension().is_some_and(|e| e == "slcalib" || e == "m");
        let bound = if text { 1e-5 } else { 1e-15 };
        assert!(
            apart(first, rig) <= bound,
            "{}: {:e}",
            path.display(),
            apart(first, rig)
        );
    }
}

#[test]
fn damaged_files_are_read_or_refused() {
    for path in files() {
        let bytes = std::fs::read(&path).unwrap();
        calibration::run(&bytes);
        for at in (0..bytes.len()).step_by(2) {
            calibration::run(&bytes[..at]);
            // The byte depends on the position.
            let mut spoilt = bytes.clone();
            spoilt[at] = SPOIL[at / 2 % SPOIL.len()];
            calibration::run(&spoilt);
        }
    }
}

#[test]
fn a_toml_calibration_is_read_as_before() {
    let rig = phasmid::profile::Profile::load("pmp-bench")
        .unwrap()
        .nominal_rig();
    let text = rig.to_toml();
    assert_eq!(
        rig_from_bytes(text.as_bytes(), "c", Sizes::default()).unwrap(),
        rig
    );
    calibration::run(text.as_bytes());
}
