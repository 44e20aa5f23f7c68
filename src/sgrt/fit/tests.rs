//! Tests that known breathing motions are recovered and that uncertainties match the actual errors.

use super::super::model::ModelOptions;
use super::super::six::SixDof;
use super::super::surface::Region;
use super::super::testing::{Breathing, Random, breathing, is_front, scan};
use super::*;
use std::f64::consts::TAU;
use std::sync::LazyLock;

struct Case {
    truth: Breathing,
    reference: Reference,
    model: MotionModel,
}

static CASE: LazyLock<Case> = LazyLock::new(|| {
    let truth = breathing(20_000, 0.6);
    let region = Region::Box {
        lo: DVec3::new(-200.0, -150.0, 30.0),
        hi: DVec3::new(200.0, 150.0, 200.0),
    };
    let reference = Reference::new(&truth.mesh, &region).unwrap();
    let options = ModelOptions::default();
    let model = MotionModel::new(&truth.snapshots, &truth.tumour, &options).unwrap();
    Case {
        truth,
        reference,
        model,
    }
});

fn options() -> FitOptions {
    FitOptions {
        correlation_mm: 0.0,
        ..FitOptions::default()
    }
}

fn tracker(options: &FitOptions) -> MotionTracker<'static> {
    MotionTracker::new(&CASE.reference, &CASE.model, Pose::IDENTITY, options).unwrap()
}

fn measured(phase: f64, amplitude: f64, count: usize, sigma: f64, seed: u64) -> Measured {
    let mut random = Random::new(seed);
    let skin = CASE.truth.skin_at(phase, amplitude);
    let points = scan(&skin, count, &mut random, is_front);
    let noisy = points.into_iter().map(|p| p + random.vector() * sigma);
    Measured::isotropic(noisy.collect(), sigma)
}

fn truth(phase: f64) -> DVec3 {
    CASE.truth.tumour_at(phase)
}

#[test]
fn tumour_is_located_between_the_phases() {
    let tracker = tracker(&options());
    let start = MotionState::mean(&CASE.model);
    for phase in [0.0, 0.3, 1.9, 3.5, 5.0] {
        let fit = tracker
            .fit(&measured(phase, 1.0, 10_000, 0.02, 1), &start)
            .unwrap();
        assert!(fit.warnings.is_empty(), "{:?}", fit.warnings);
        let off = (fit.tumour_mm - truth(phase)).length();
        // The prior's pull is negligible; f32 and the tumour's roundness leave a few microns.
        assert!(off < 0.03, "{phase}: {off}");
        let mesh = fit.tumour(&CASE.model);
        let (_, centroid) = phasmid_measure::solid_moments(&mesh.vertices, &mesh.triangles);
        assert!((centroid - truth(phase)).length() < 0.03);
    }
}

#[test]
fn deeper_breath_is_followed_with_the_predicted_error() {
    // 1.5 times the depth: mean and variation both grow. The two components can follow the variation,
    // but only the part of the mean that lies along them.
    let tracker = tracker(&options());
    let start = MotionState::mean(&CASE.model);
    let fit = tracker
        .fit(&measured(2.5, 1.5, 10_000, 0.1, 2), &start)
        .unwrap();
    let deeper = CASE.truth.tumour_shift(2.5, 1.5) - CASE.truth.tumour_shift(2.5, 1.0);
    let off = (fit.tumour_mm - truth(2.5) - deeper).length();
    // In closed form: 0.864 of the added half of the mean lies along the components.
    assert!((off - 0.136 * 0.5 * 6.2).abs() < 0.1, "{off}");
    assert!(deeper.length() > 2.0, "{deeper}");
}

#[test]
fn a_covariance_of_the_fit_is_honest() {
    let tracker = tracker(&options());
    let start = MotionState::mean(&CASE.model);
    let runs = 100;
    let mut sum = 0.0;
    for seed in 0..runs {
        let phase = TAU * Random::new(seed).uniform();
        let fit = tracker
            .fit(&measured(phase, 1.0, 800, 0.5, 50 + seed), &start)
            .unwrap();
        // The two coefficients of this phase combine a sine and a cosine.
        let phases = CASE.model.coefficients();
        let told: Vec<f64> = (0..2)
            .map(|k| {
                let along = |f: fn(f64) -> f64| {
                    (0..10)
                        .map(|i| f(TAU * i as f64 / 10.0) * phases[i][k])
                        .sum::<f64>()
                        / 5.0
                };
                along(f64::cos) * phase.cos() + along(f64::sin) * phase.sin()
            })
            .collect();
        let error = DVector::from_fn(2, |k, _| fit.state.coefficients[k] - told[k]);
        sum += error.dot(&(fit.covariance.clone().try_inverse().unwrap() * &error));
    }
    // Over 100 runs of two coefficients, the mean chi-square is 2 with standard deviation 0.2.
    let square = sum / runs as f64;
    assert!((1.4..2.6).contains(&square), "{square}");
}

#[test]
fn motion_not_visible_on_skin_stays_uncertain() {
    // One component only: the lag is left out and appears in the tumour's uncertainty.
    let one = ModelOptions {
        most: 1,
        ..ModelOptions::default()
    };
    let model = MotionModel::new(&CASE.truth.snapshots, &CASE.truth.tumour, &one).unwrap();
    let tracker = MotionTracker::new(&CASE.reference, &model, Pose::IDENTITY, &options()).unwrap();
    let start = MotionState::mean(&model);
    let (mut worst, mut squares) = (0.0_f64, 0.0);
    for k in 0..10 {
        let phase = TAU * f64::from(k) / 10.0;
        let fit = tracker
            .fit(&measured(phase, 1.0, 3000, 0.05, 3), &start)
            .unwrap();
        let off = fit.tumour_mm - truth(phase);
        let told = fit.tumour_covariance.y_axis.y.sqrt();
        worst = worst.max(off.length() / told);
        squares += off.length_squared() / 10.0;
    }
    // The prior is twice planning's standard deviation; no error exceeds about 1.5 times planning's.
    assert!(
        worst < 2.0 && squares.sqrt() > 0.2,
        "{worst} {}",
        squares.sqrt()
    );
    // A region that does not breathe determines nothing: the tumour keeps its prior.
    let flank = Region::Sphere {
        centre: DVec3::new(0.0, 0.0, -118.0),
        radius_mm: 90.0,
    };
    let still = Reference::new(&CASE.truth.mesh, &flank).unwrap();
    let tracker = MotionTracker::new(&still, &CASE.model, Pose::IDENTITY, &options()).unwrap();
    let points = scan(&CASE.truth.mesh, 5000, &mut Random::new(4), |p| p.z < -90.0);
    let start = MotionState::mean(&CASE.model);
    let fit = tracker
        .fit(&Measured::isotropic(points, 0.3), &start)
        .unwrap();
    for k in 0..2 {
        assert!(fit.covariance[(k, k)].sqrt() > 1.9, "{}", fit.covariance);
    }
    let prior: f64 = CASE
        .model
        .centroid_modes()
        .iter()
        .map(|m| (m.y * 2.0).powi(2))
        .sum();
    assert!((fit.tumour_covariance.y_axis.y / prior - 1.0).abs() < 0.1);
}

#[test]
fn set_up_error_is_separated_from_breathing() {
    let pose = SixDof {
        translation_mm: DVec3::new(1.5, -2.0, 1.0),
        rotation_deg: DVec3::new(0.4, -0.3, 0.5),
    }
    .pose();
    let with = FitOptions {
        set_up: Some(SetUp {
            shift_sd_mm: 3.0,
            turn_sd_deg: 1.5,
        }),
        ..options()
    };
    let tracker = tracker(&with);
    let mut scan = measured(2.0, 1.0, 10_000, 0.1, 5);
    for p in &mut scan.points {
        *p = pose.point(*p);
    }
    let fit = tracker.fit(&scan, &MotionState::mean(&CASE.model)).unwrap();
    assert!(fit.warnings.is_empty(), "{:?}", fit.warnings);
    let off = fit.tumour_mm - pose.point(truth(2.0));
    assert!(off.length() < 0.3, "{off}");
    let inverse = fit.tumour_covariance.inverse();
    assert!(
        off.dot(inverse * off) < 16.0,
        "{off} {}",
        fit.tumour_covariance
    );
}

#[test]
fn outliers_are_tolerated_and_warm_starts_are_faster() {
    let tracker = tracker(&options());
    let mut scan = measured(1.0, 1.0, 8000, 0.1, 6);
    let mut random = Random::new(7);
    for p in scan.points.iter_mut().step_by(5) {
        p.z += 5.0 + 10.0 * random.uniform();
    }
    let cold = tracker.fit(&scan, &MotionState::mean(&CASE.model)).unwrap();
    assert!((cold.tumour_mm - truth(1.0)).length() < 0.1);
    let warm = tracker.fit(&scan, &cold.state).unwrap();
    assert!(
        warm.iterations < cold.iterations,
        "{} {}",
        warm.iterations,
        cold.iterations
    );
    assert!((warm.tumour_mm - cold.tumour_mm).length() < 0.02);
}

#[test]
fn misfit_is_warned_of_and_bad_input_refused() {
    let tracker = tracker(&options());
    let start = MotionState::mean(&CASE.model);
    let empty = Measured::isotropic(Vec::new(), 0.1);
    assert!(matches!(
        tracker.fit(&empty, &start),
        Err(Lost::Points { found: 0, .. })
    ));
    // A cough: five times the displacement of any breath.
    let fit = tracker
        .fit(&measured(3.1, 5.0, 5000, 0.1, 8), &start)
        .unwrap();
    assert!(!fit.warnings.is_empty());
    let other = MotionModel::new(
        &Snapshots2::of(&CASE.truth),
        &CASE.truth.tumour,
        &ModelOptions::default(),
    )
    .unwrap();
    let words = match MotionTracker::new(&CASE.reference, &other, Pose::IDENTITY, &options()) {
        Err(e) => e.to_string(),
        Ok(_) => panic!("taken"),
    };
    assert!(words.contains("those of the reference surface"), "{words}");
    let bad = FitOptions {
        prior: 0.0,
        ..options()
    };
    assert!(MotionTracker::new(&CASE.reference, &CASE.model, Pose::IDENTITY, &bad).is_err());
}

struct Snapshots2;

impl Snapshots2 {
    /// Snapshots of a skin with one vertex fewer.
    fn of(truth: &Breathing) -> super::super::model::Snapshots {
        let mut all = truth.snapshots.clone();
        all.skin.iter_mut().for_each(|f| {
            f.pop();
        });
        all
    }
}

#[test]
fn result_does_not_depend_on_thread_count() {
    let tracker = tracker(&options());
    let scan = measured(1.0, 1.0, 3000, 0.1, 9);
    let start = MotionState::mean(&CASE.model);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let fit = pool.install(|| tracker.fit(&scan, &start).unwrap());
        (fit.state, fit.covariance, fit.tumour_mm)
    };
    assert_eq!(with(1), with(3));
}
