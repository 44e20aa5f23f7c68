//! Tests that known poses are recovered and that covariances match the actual errors.

mod shapes;

use super::super::six::SixDof;
use super::super::surface::Region;
use super::super::testing::{Random, is_front, moved, patient, scan, sphere};
use super::*;
use nalgebra::Vector6;
use phasmid_calibrate::solve::chi_square_below;
use phasmid_geometry::Mesh;
use std::sync::LazyLock;

static PATIENT: LazyLock<(Mesh, Reference)> = LazyLock::new(|| {
    let mesh = patient(20_000);
    let region = Region::Box {
        lo: DVec3::new(-200.0, -150.0, 30.0),
        hi: DVec3::new(200.0, 150.0, 200.0),
    };
    let reference = Reference::new(&mesh, &region).unwrap();
    (mesh, reference)
});

fn six(t: [f64; 3], r: [f64; 3]) -> SixDof {
    SixDof {
        translation_mm: DVec3::from_array(t),
        rotation_deg: DVec3::from_array(r),
    }
}

fn white() -> RigidOptions {
    RigidOptions {
        correlation_mm: 0.0,
        ..RigidOptions::default()
    }
}

fn near() -> Start {
    Start::Near(Pose::IDENTITY)
}

/// Errors of translation and rotation, in millimetres and degrees.
fn miss(fit: &RigidFit, truth: &SixDof) -> (f64, f64) {
    (
        (fit.six.translation_mm - truth.translation_mm).length(),
        (fit.six.rotation_deg - truth.rotation_deg).length(),
    )
}

#[test]
fn pose_of_torso_is_exact_without_noise() {
    let (mesh, reference) = &*PATIENT;
    let truth = six([4.0, -6.0, 3.0], [1.0, -0.7, 1.5]);
    let points = scan(mesh, 10_000, &mut Random::new(1), is_front);
    let measured = Measured::isotropic(moved(&points, &truth.pose()), 0.1);
    let options = RigidOptions {
        step_mm: 1e-6,
        ..white()
    };
    let fit = track_rigid(&measured, reference, &near(), &options).unwrap();
    let (mm, deg) = miss(&fit, &truth);
    assert!(mm < 1e-4 && deg < 1e-4, "{mm} mm, {deg} degrees");
    assert!(fit.warnings.is_empty() && fit.determined == 6, "{fit:?}");
    assert!(fit.iterations < 20, "{}", fit.iterations);
}

#[test]
fn a_covariance_is_honest() {
    let (mesh, reference) = &*PATIENT;
    let truth = six([1.0, 2.0, -1.0], [0.3, -0.2, 0.5]);
    let runs = 200;
    let (mut sum, mut below) = (0.0, 0);
    let mut mean = Vector6::zeros();
    for seed in 0..runs {
        let mut random = Random::new(100 + seed);
        let points: Vec<DVec3> = scan(mesh, 1500, &mut random, is_front)
            .into_iter()
            .map(|p| truth.pose().point(p) + random.vector() * 0.5)
            .collect();
        let measured = Measured::isotropic(points, 0.5);
        let fit = track_rigid(&measured, reference, &near(), &white()).unwrap();
        assert_eq!(fit.determined, 6);
        let off = fit.room_from_reference.rotation * truth.pose().rotation.transpose();
        let turn = DVec3::new(
            off.y_axis.z - off.z_axis.y,
            off.z_axis.x - off.x_axis.z,
            off.x_axis.y - off.y_axis.x,
        ) / 2.0;
        let shift = fit.six.translation_mm - truth.translation_mm;
        let error = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
        let inverse = fit.covariance.try_inverse().unwrap();
        let square = error.dot(&(inverse * error));
        sum += square;
        below += u32::from(chi_square_below(square, 6) < 0.95);
        // Whiten the errors, so that runs can be averaged.
        mean += inverse.cholesky().unwrap().l().transpose() * error;
    }
    // Over 200 runs of six unknowns, the mean chi-square is 6 with standard deviation 0.25, and the
    // fraction below the 95 % quantile has standard deviation 1.5 %.
    let square = sum / runs as f64;
    assert!((5.0..7.0).contains(&square), "{square}");
    assert!((178..=200).contains(&below), "{below}");
    // The mean error is zero: each whitened component has standard deviation 1 / sqrt(200), so the
    // sum of squares is chi-square with six degrees of freedom.
    let bias = (mean / runs as f64).norm_squared() * runs as f64;
    assert!(chi_square_below(bias, 6) < 0.9999, "{bias}");
}

#[test]
fn noise_along_oblique_rays_hardly_shifts() {
    let (mesh, reference) = &*PATIENT;
    let eyes = [
        DVec3::new(1500.0, -300.0, 1800.0),
        DVec3::new(-1500.0, -300.0, 1800.0),
    ];
    let (mut mean, runs) = (DVec3::ZERO, 40);
    for seed in 0..runs {
        let mut random = Random::new(900 + seed);
        let mut measured = Measured {
            eyes: eyes.map(Some).to_vec(),
            ..Measured::default()
        };
        for (i, p) in scan(mesh, 4000, &mut random, is_front)
            .into_iter()
            .enumerate()
        {
            let ray = (p - eyes[i % 2]).normalize();
            measured.points.push(p + ray * (0.5 * random.normal()));
            measured.sigma_mm.push(0.5);
            measured.pod.push((i % 2) as u8);
        }
        let fit = track_rigid(&measured, reference, &near(), &white()).unwrap();
        mean += fit.six.translation_mm / runs as f64;
    }
    // The standard deviation of the mean is about 0.01 mm along the body, less across.
    assert!(mean.length() < 0.03, "{mean}");
}

#[test]
fn bias_of_noise_on_curved_surface_is_corrected() {
    // On a sphere of 150 mm radius the bias is s^2 / R outwards: uncorrected, the residuals would
    // have a mean of 0.027 mm.
    let mesh = sphere();
    let reference = Reference::new(&mesh, &Region::All).unwrap();
    let mut random = Random::new(4);
    let s = 2.0;
    let centre = DVec3::new(10.0, 20.0, -40.0);
    let inner = |p: DVec3| (p - centre).truncate().abs().max_element() < 90.0;
    let points: Vec<DVec3> = scan(&mesh, 400_000, &mut random, inner)
        .into_iter()
        .map(|p| p + random.vector() * s)
        .collect();
    let mut rows = Vec::new();
    let limits = Limits {
        capture_mm: 60.0,
        anywhere: false,
    };
    let measured = Measured::isotropic(points, s);
    update(
        &mut rows,
        &measured,
        &reference,
        &Pose::IDENTITY,
        limits,
        true,
    );
    let mean = rows.iter().map(|r| r.residual_mm).sum::<f64>() / rows.len() as f64;
    // The standard deviation of the mean is 0.0032 mm.
    assert!(mean.abs() < 0.011, "{mean}");
}

#[test]
fn tolerates_a_fifth_of_outliers_and_missing_parts() {
    let (mesh, reference) = &*PATIENT;
    let truth = six([3.0, 5.0, -4.0], [-0.8, 0.6, 0.9]);
    let mut random = Random::new(7);
    // A band shadowed by an arm and everything beyond x = 70 are missing.
    let keep = |p: DVec3| is_front(p) && p.x < 70.0 && !(20.0..60.0).contains(&p.y);
    let mut points = moved(&scan(mesh, 10_000, &mut random, keep), &truth.pose());
    for (i, p) in points.iter_mut().enumerate() {
        *p += random.vector() * 0.2;
        if i % 5 == 0 {
            // All outliers lie on one side, like a sheet above the skin.
            *p += DVec3::new(0.0, 0.0, 6.0 + 20.0 * random.uniform());
        }
    }
    let measured = Measured::isotropic(points, 0.2);
    let fit = track_rigid(&measured, reference, &near(), &white()).unwrap();
    let (mm, deg) = miss(&fit, &truth);
    assert!(mm < 0.05 && deg < 0.02, "{mm} mm, {deg} degrees");
    assert_eq!(fit.determined, 6);
    assert!(fit.coverage < 0.8, "{}", fit.coverage);
}

#[test]
fn a_patient_far_away_is_found() {
    let (mesh, reference) = &*PATIENT;
    let points = scan(mesh, 6000, &mut Random::new(8), is_front);
    let starts = [
        six([50.0, 0.0, 0.0], [0.0, 0.0, 10.0]),
        six([0.0, -50.0, 20.0], [10.0, 0.0, 0.0]),
        six([-30.0, 50.0, -30.0], [0.0, -10.0, 0.0]),
        six([-50.0, -50.0, 50.0], [5.0, 5.0, -8.0]),
    ];
    for truth in starts {
        let measured = Measured::isotropic(moved(&points, &truth.pose()), 0.1);
        let start = Start::Within {
            around: Pose::IDENTITY,
            range_mm: 50.0,
        };
        let fit = track_rigid(&measured, reference, &start, &white()).unwrap();
        let (mm, deg) = miss(&fit, &truth);
        assert!(
            mm < 0.01 && deg < 0.01,
            "{truth}: {mm} mm, {deg} degrees, {:?}",
            fit.warnings
        );
        assert!(fit.warnings.is_empty(), "{:?}", fit.warnings);
    }
}

#[test]
fn result_does_not_depend_on_thread_count() {
    let (mesh, reference) = &*PATIENT;
    let mut random = Random::new(13);
    let points = scan(mesh, 5000, &mut random, is_front);
    let measured = Measured::isotropic(
        moved(&points, &six([2.0, 1.0, 3.0], [1.0, 0.5, 0.2]).pose()),
        0.1,
    );
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let fit = pool.install(|| track_rigid(&measured, reference, &near(), &white()).unwrap());
        (fit.room_from_reference, fit.covariance)
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn refuses_scans_without_answer_and_warns_of_misfit() {
    let (mesh, reference) = &*PATIENT;
    let say = |points: Vec<DVec3>| match track_rigid(
        &Measured::isotropic(points, 0.1),
        reference,
        &near(),
        &white(),
    ) {
        Err(lost) => lost.to_string(),
        Ok(fit) => panic!("{fit:?}"),
    };
    assert!(say(vec![]).contains("0 measured points"));
    assert!(say(vec![DVec3::splat(1e5); 1000]).contains("0 measured points"));
    let mut random = Random::new(14);
    let all = scan(mesh, 20_000, &mut random, is_front);
    let one = all
        .iter()
        .copied()
        .find(|p| p.z > 60.0 && p.truncate().length() < 60.0)
        .unwrap();
    assert!(say(vec![one; 1000]).contains("line"));
    // A scan of a patch of a few centimetres determines little and gives warnings.
    let patch: Vec<DVec3> = all
        .iter()
        .copied()
        .filter(|p| (*p - one).length() < 25.0)
        .collect();
    let measured = Measured::isotropic(patch, 0.3);
    let fit = track_rigid(&measured, reference, &near(), &white()).unwrap();
    let words: Vec<String> = fit.warnings.iter().map(ToString::to_string).collect();
    assert!(
        words
            .iter()
            .any(|w| w.contains("region of interest is measured")),
        "{words:?}"
    );
    assert!(
        words.iter().any(|w| w.contains("not determined")),
        "{words:?}"
    );
    // A different body does not fit.
    let other = phasmid_geometry::shapes::torso(&phasmid_geometry::shapes::Torso {
        seed: 9,
        ..Default::default()
    });
    let points = scan(&other, 5000, &mut random, |p| p.z < -130.0)
        .into_iter()
        .map(|v| DVec3::new(v.x, -v.y, -v.z) - DVec3::new(0.0, 60.0, 120.0))
        .collect();
    let fit = track_rigid(
        &Measured::isotropic(points, 0.1),
        reference,
        &near(),
        &white(),
    )
    .unwrap();
    assert!(
        fit.warnings
            .iter()
            .any(|w| matches!(w, Warning::Misfit { .. })),
        "{:?}",
        fit.warnings
    );
}

#[test]
fn correlated_noise_and_pods_widen_the_covariance() {
    let (mesh, reference) = &*PATIENT;
    let mut random = Random::new(15);
    let points: Vec<DVec3> = scan(mesh, 3000, &mut random, is_front)
        .into_iter()
        .map(|p| p + random.vector() * 0.3)
        .collect();
    let measured = Measured::isotropic(points, 0.3);
    let vrt = |options: &RigidOptions| {
        let fit = track_rigid(&measured, reference, &near(), options).unwrap();
        (
            fit.deviations()[2],
            fit.points as f64 / (fit.coverage * reference.area_mm2()),
        )
    };
    let (plain, density) = vrt(&white());
    let (alike, _) = vrt(&RigidOptions {
        correlation_mm: 4.0,
        ..white()
    });
    let told = (1.0 + std::f64::consts::TAU * 16.0 * density).sqrt();
    assert!(
        (alike / plain / told - 1.0).abs() < 1e-6,
        "{alike} {plain} {told}"
    );
    // A pod's offset is not averaged out: with one pod it appears in full.
    let (offset, _) = vrt(&RigidOptions {
        pod_sd_mm: 0.4,
        ..white()
    });
    assert!(
        (offset.hypot(0.0) / plain.hypot(0.4) - 1.0).abs() < 0.01,
        "{offset}"
    );
}
