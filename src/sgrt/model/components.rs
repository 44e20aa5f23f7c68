//! Principal components by the method of snapshots (from the matrix of the snapshots' inner
//! products).

use glam::{DVec3, Vec3};
use nalgebra::DMatrix;
use phasmid_core::error::{Error, Result};
use rayon::prelude::*;

/// Settings for choosing components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelOptions {
    /// Fraction of the variance over the phases that the kept components must explain, 0 to 1. It is
    /// near 1 because a lag of a tenth of a breath between skin and tumour is less than a hundredth
    /// of the variance, yet millimetres of the tumour.
    pub energy: f64,
    /// Maximum number of components, 1 to 6.
    pub most: usize,
}

impl Default for ModelOptions {
    fn default() -> Self {
        Self {
            energy: 0.999,
            most: 4,
        }
    }
}

/// Mean and modes of one part (skin or tumour) of the snapshot vector.
pub(super) struct Field {
    pub(super) mean: Vec<Vec3>,
    /// All modes of each vertex in turn, scaled so that their coefficients have standard deviation 1.
    pub(super) all_modes: Vec<Vec3>,
}

/// The principal components of the snapshots.
pub(super) struct Found<const N: usize> {
    pub(super) fields: [Field; N],
    /// Number of modes found.
    pub(super) all: usize,
    /// Number of modes kept.
    pub(super) modes: usize,
    pub(super) energies: Vec<f64>,
    /// Coefficients of the kept modes, by phase.
    pub(super) coefficients: Vec<Vec<f64>>,
}

/// Components below this fraction of the total variance are rounding errors of the f32 displacements.
const ROUNDING: f64 = 1e-10;

/// Computes the components of parts that have equal weight whatever their number of vertices. All
/// parts have the same number of phases, and all phases of a part the same number of displacements.
pub(super) fn components<const N: usize>(
    parts: [&Vec<Vec<Vec3>>; N],
    options: &ModelOptions,
) -> Result<Found<N>> {
    let phases = parts[0].len();
    let means = parts.map(|part| mean(part));
    let mut products = DMatrix::<f64>::zeros(phases, phases);
    for (part, mean) in parts.iter().zip(&means) {
        let share = 1.0 / (mean.len() * phases) as f64;
        for i in 0..phases {
            for j in 0..=i {
                let p = product(&part[i], &part[j], mean) * share;
                products[(i, j)] += p;
                if i != j {
                    products[(j, i)] += p;
                }
            }
        }
    }
    let eigen = products.symmetric_eigen();
    let mut order: Vec<usize> = (0..phases).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let total: f64 = eigen.eigenvalues.iter().map(|v| v.max(0.0)).sum();
    if !(total > 0.0) {
        return Err(Error::input(
            "motion model",
            "no motion from phase to phase",
            "displacements that differ",
        ));
    }
    order.retain(|&k| eigen.eigenvalues[k] > ROUNDING * total);
    let energies: Vec<f64> = order
        .iter()
        .map(|&k| eigen.eigenvalues[k] / total)
        .collect();
    let mut modes = 0;
    let mut reached = 0.0;
    while modes < order.len().min(options.most) && reached < options.energy {
        reached += energies[modes];
        modes += 1;
    }
    // The coefficient at phase i is sqrt(n) v_i: mean 0, variance 1.
    let scores: Vec<Vec<f64>> = order
        .iter()
        .map(|&k| {
            let v = eigen.eigenvectors.column(k);
            // The sign of a component is arbitrary: make its largest coefficient positive.
            let largest = v
                .iter()
                .fold(0.0_f64, |m, x| if x.abs() > m.abs() { *x } else { m });
            let sign = largest.signum() * (phases as f64).sqrt();
            v.iter().map(|x| x * sign).collect()
        })
        .collect();
    let fields = std::array::from_fn(|p| Field {
        all_modes: regress(parts[p], &means[p], &scores),
        mean: means[p].iter().map(|m| m.as_vec3()).collect(),
    });
    Ok(Found {
        fields,
        all: order.len(),
        modes,
        energies,
        coefficients: (0..phases)
            .map(|i| scores[..modes].iter().map(|s| s[i]).collect())
            .collect(),
    })
}

fn mean(part: &[Vec<Vec3>]) -> Vec<DVec3> {
    let n = part.len() as f64;
    (0..part[0].len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|v| part.iter().map(|phase| phase[v].as_dvec3()).sum::<DVec3>() / n)
        .collect()
}

/// Inner product of the displacements at two phases, each minus the mean, summed in a fixed order.
fn product(a: &[Vec3], b: &[Vec3], mean: &[DVec3]) -> f64 {
    let each = |v: usize| (a[v].as_dvec3() - mean[v]).dot(b[v].as_dvec3() - mean[v]);
    (0..mean.len()).map(each).sum()
}

/// For each vertex, the displacement per unit of each score: the mean of displacement times score.
fn regress(part: &[Vec<Vec3>], mean: &[DVec3], scores: &[Vec<f64>]) -> Vec<Vec3> {
    let n = part.len() as f64;
    (0..mean.len())
        .into_par_iter()
        .with_min_len(1024)
        .flat_map_iter(|v| {
            scores.iter().map(move |score| {
                let along = part.iter().zip(score);
                let sum: DVec3 = along.map(|(f, s)| (f[v].as_dvec3() - mean[v]) * *s).sum();
                (sum / n).as_vec3()
            })
        })
        .collect()
}
