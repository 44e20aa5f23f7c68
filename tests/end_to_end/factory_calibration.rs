//! The calibration that a device reports: the errors of depth that it causes, pooled over serial
//! numbers, are as large as its covariance predicts.

use crate::served::{Served, phasmid, text as words};
use glam::{DVec2, DVec3};
use phasmid::calibrate::{Measured, Triangulator};
use phasmid::geometry::Rig;
use phasmid::geometry::parameters::RIG;
use phasmid::profile::{Profile, profile_names};
use rayon::prelude::*;
use std::ops::Range;

/// Returns camera pixels over the image, each with the projector pixel that lights a tilted plane
/// there and the depth.
fn lit(truth: &Rig) -> Vec<(DVec2, DVec2, f64)> {
    let lens = &truth.camera.lens;
    let size = DVec2::new(lens.width_px.into(), lens.height_px.into());
    let depth = truth.meeting_mm().unwrap();
    let normal = DVec3::new(0.3, 0.2, 1.0);
    let mut lit = Vec::new();
    for row in 1..8 {
        for column in 1..8 {
            let px = (size * DVec2::new(column.into(), row.into()) / 8.0).round();
            let ray = lens.ray(px);
            let point = ray * (depth / normal.dot(ray));
            let at = truth
                .projector
                .project(truth.camera.rig_from_view.point(point));
            if let Some(at) = at.filter(|at| truth.projector.lens.contains(*at)) {
                lit.push((px, at, point.z));
            }
        }
    }
    assert!(lit.len() > 10);
    lit
}

fn triangulator(rig: &Rig) -> Triangulator {
    let lens = &rig.camera.lens;
    Triangulator::new(rig, lens.width_px as usize, lens.height_px as usize).unwrap()
}

fn measured(px: f64) -> Option<Measured> {
    Some(Measured { px, sigma: 0.01 })
}

/// Returns sums over points and serial numbers of a profile: the squares of the depth error divided
/// by its sigma, the squares of the depth error, and the number of points.
fn depth_errors(name: &str, serials: Range<u32>) -> [f64; 3] {
    let profile = Profile::load(name).unwrap();
    let truth = profile.nominal_rig();
    let lit = lit(&truth);
    let pixels: Vec<_> = lit
        .iter()
        .map(|(px, at, _)| (px.to_array(), [measured(at.x), None]))
        .collect();
    let sums: Vec<[f64; 3]> = serials
        .into_par_iter()
        .map(|serial| {
            let mut profile = profile.clone();
            profile.identity.serial = format!("SN{serial:05}");
            let reported = triangulator(&profile.factory_rig().unwrap());
            let sigma = reported.calibration_sigma(&pixels).unwrap();
            let mut sums = [0.0; 3];
            for ((px, at, z), sigma) in lit.iter().zip(sigma) {
                let (depth, _) = reported.depth(*px, measured(at.x), None).unwrap();
                sums[0] += ((depth - z) / sigma).powi(2);
                sums[1] += (depth - z).powi(2);
                sums[2] += 1.0;
            }
            sums
        })
        .collect();
    [0, 1, 2].map(|i| sums.iter().map(|sum| sum[i]).sum())
}

/// Prints the figures of a profile, and checks the ratio of errors to standard deviations.
fn check(name: &str, [normalised, square, count]: [f64; 3], bounds: Range<f64>) {
    let ratio = (normalised / count).sqrt();
    let rms_mm = (square / count).sqrt();
    println!("{name}: error over sigma {ratio:.3}, RMS {rms_mm:.4} mm");
    assert!(bounds.contains(&ratio), "{name}: {ratio}");
}

#[test]
fn depth_errors_are_as_large_as_their_covariances_say() {
    let mut pooled = [0.0; 3];
    for (i, name) in (0..).zip(profile_names()) {
        // A serial number has the same draws in every profile.
        let sums = depth_errors(name, 24 * i..24 * (i + 1));
        check(name, sums, 0.7..1.3);
        pooled = [0, 1, 2].map(|i| pooled[i] + sums[i]);
    }
    check("all profiles", pooled, 0.9..1.1);
}

#[test]
#[ignore = "1200 factory calibrations: a minute"]
fn depth_errors_of_200_serial_numbers_of_each_profile_are_as_large() {
    for name in profile_names() {
        check(name, depth_errors(name, 0..200), 0.9..1.1);
    }
}

/// Drawing the errors of the parameters independently would exaggerate the errors of depth, so they
/// are drawn jointly.
#[test]
fn independent_errors_of_the_parameters_would_exaggerate_errors_of_depth() {
    for name in profile_names() {
        let profile = Profile::load(name).unwrap();
        let truth = profile.nominal_rig();
        let rig = profile.factory_rig().unwrap();
        let covariance = rig.covariance.unwrap();
        let (mut joint, mut apart) = (0.0, 0.0);
        let lit = lit(&truth);
        let pixels: Vec<_> = lit
            .iter()
            .map(|(px, at, _)| (px.to_array(), [measured(at.x), None]))
            .collect();
        for sigma in triangulator(&rig).calibration_sigma(&pixels).unwrap() {
            joint += sigma * sigma;
        }
        for parameter in 0..RIG {
            let mut step = [0.0; RIG];
            step[parameter] = covariance.of(parameter, parameter).sqrt();
            let stepped = triangulator(&truth.stepped(&step));
            for (px, at, z) in &lit {
                let (depth, _) = stepped.depth(*px, measured(at.x), None).unwrap();
                apart += (depth - z).powi(2);
            }
        }
        let ratio = (apart / joint).sqrt();
        println!("{name}: {ratio:.2}");
        assert!(ratio > 2.0, "{name}: {ratio}");
    }
}

/// A device that could not be calibrated can still be scanned, and its user can calibrate it.
#[test]
fn device_that_could_not_be_calibrated_is_scanned() {
    let folder = tempfile::tempdir().unwrap();
    let text = phasmid::profile::profile_text("webcam-grey").unwrap();
    let away = folder.path().join("away.toml");
    // At this distance, the fields of view of camera and projector do not overlap.
    let text = text.replace("[calibration]\n", "[calibration]\ndistance_mm = 20.0\n");
    std::fs::write(&away, text).unwrap();
    let away = away.to_str().unwrap();
    let check = phasmid().args(["profile", "check", away]).output().unwrap();
    let said = String::from_utf8_lossy(&check.stdout).into_owned();
    assert!(check.status.success(), "{said}");
    assert!(said.contains("no calibration: "), "{said}");

    let mut serve = phasmid();
    serve.args(["serve", "--profile", away, "--scene", "plane"]);
    let served = Served::spawn(&mut serve);
    let scan = served.scan(&folder.path().join("scan"), &["--json"]);
    assert!(scan.status.success(), "{}", words(&scan));
    let said: serde_json::Value = serde_json::from_slice(&scan.stdout).unwrap();
    assert_eq!(said["calibration"], "none");
    assert!(said["decoding"]["points"].is_null());
    let valid = said["decoding"]["axes"][0]["valid"].as_u64().unwrap();
    assert!(valid > 10_000, "{valid}");
}
