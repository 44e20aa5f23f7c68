//! Tests the components of motions known in closed form.

use super::super::surface::{Reference, Region};
use super::super::testing::{Random, breathing, is_front};
use super::*;
use glam::DMat3;

#[test]
fn two_motions_in_quadrature_are_two_components() {
    let case = breathing(4000, 0.6);
    let model = MotionModel::new(&case.snapshots, &case.tumour, &ModelOptions::default()).unwrap();
    assert_eq!(model.components(), 2);
    assert!((model.energies().iter().sum::<f64>() - 1.0).abs() < 1e-9);
    // Over the phases, the coefficients have mean 0 and variance 1 and are uncorrelated.
    let phases = model.coefficients();
    for a in 0..2 {
        let mean: f64 = phases.iter().map(|c| c[a]).sum::<f64>() / 10.0;
        assert!(mean.abs() < 1e-6, "{mean}");
        for b in 0..2 {
            let product: f64 = phases.iter().map(|c| c[a] * c[b]).sum::<f64>() / 10.0;
            assert!((product - f64::from(u8::from(a == b))).abs() < 1e-6);
        }
    }
    // The coefficients reproduce every phase of skin and tumour.
    for (k, c) in phases.iter().enumerate() {
        for v in (0..model.skin_vertices()).step_by(17) {
            let off = model.skin(v, c) - case.snapshots.skin[k][v];
            assert!(off.length() < 1e-4, "{k} {v}: {off}");
        }
        let mesh = model.tumour(c);
        let (_, centroid) = solid_moments(&mesh.vertices, &mesh.triangles);
        assert!((model.centroid(c) - centroid).length() < 0.01);
        let told = case.tumour_at(std::f64::consts::TAU * k as f64 / 10.0);
        assert!((model.centroid(c) - told).length() < 0.02, "{k}");
    }
    assert!(model.left_out(&[]).iter().all(|h| h.length() < 1e-3));
}

#[test]
fn error_of_omitted_components_is_predicted() {
    let case = breathing(4000, 0.6);
    let one = ModelOptions {
        most: 1,
        ..ModelOptions::default()
    };
    let model = MotionModel::new(&case.snapshots, &case.tumour, &one).unwrap();
    assert_eq!(model.components(), 1);
    // Fitted to the skin along its normals by least squares at each phase, the model misses the
    // tumour by the predicted amount.
    let mesh = &case.mesh;
    let reference = Reference::new(mesh, &Region::All).unwrap();
    let region: Vec<(u32, DVec3)> = reference
        .region_normals()
        .into_iter()
        .filter(|(v, _)| is_front(mesh.vertices[*v as usize]))
        .collect();
    let (mut missed, mut least) = (DMat3::ZERO, DMat3::ZERO);
    for k in 0..10 {
        let (mut along, mut square) = (0.0, 0.0);
        for &(v, n) in &region {
            let n = n.as_vec3();
            let mean = model.skin(v as usize, &[0.0]);
            let mode = f64::from((model.skin(v as usize, &[1.0]) - mean).dot(n));
            let seen = f64::from((case.snapshots.skin[k][v as usize] - mean).dot(n));
            along += mode * seen;
            square += mode * mode;
        }
        let truth = case.tumour_at(std::f64::consts::TAU * k as f64 / 10.0);
        missed += outer(model.centroid(&[along / square]) - truth) * 0.1;
        least += outer(model.centroid(&model.coefficients()[k]) - truth) * 0.1;
    }
    let told: DMat3 = model.left_out(&region).into_iter().map(outer).sum();
    let size = |m: DMat3| {
        m.to_cols_array()
            .iter()
            .fold(0.0_f64, |m, x| m.max(x.abs()))
    };
    assert!(size(missed) > 10.0 * size(least), "{missed} {least}");
    assert!(size(missed - told) < 0.02 * size(missed), "{missed} {told}");
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

#[test]
fn energy_sets_the_number_of_components() {
    let mut case = breathing(4000, 0.6);
    let mut random = Random::new(3);
    for field in case.snapshots.skin.iter_mut().flatten() {
        *field += random.vector().as_vec3() * 0.02;
    }
    let count = |energy, most| {
        let options = ModelOptions { energy, most };
        MotionModel::new(&case.snapshots, &case.tumour, &options)
            .unwrap()
            .components()
    };
    assert_eq!((count(0.3, 4), count(0.999, 4), count(1.0, 5)), (1, 2, 5));
}

#[test]
fn refuses_mismatched_snapshots_by_name() {
    let case = breathing(2000, 0.6);
    let words = |snapshots: &Snapshots, options: &ModelOptions| {
        MotionModel::new(snapshots, &case.tumour, options)
            .unwrap_err()
            .to_string()
    };
    let options = ModelOptions::default();
    let mut short = case.snapshots.clone();
    short.tumour[3].pop();
    assert!(words(&short, &options).contains("tumour at phase 3"));
    let mut few = case.snapshots.clone();
    few.tumour.pop();
    assert!(words(&few, &options).contains("10 phases of the skin, 9 of the tumour"));
    let mut bad = case.snapshots.clone();
    bad.skin[1][7].y = f32::NAN;
    assert!(words(&bad, &options).contains("skin at phase 1: vertex 7"));
    let mut still = case.snapshots.clone();
    for part in [&mut still.skin, &mut still.tumour] {
        let first = part[0].clone();
        part.iter_mut().for_each(|f| f.clone_from(&first));
    }
    assert!(words(&still, &options).contains("no motion"));
    for options in [
        ModelOptions {
            energy: 0.0,
            ..options
        },
        ModelOptions { most: 9, ..options },
    ] {
        assert!(words(&case.snapshots, &options).contains("; expected "));
    }
}
