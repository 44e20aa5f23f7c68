//! Motion model of a patient: principal components of the displacements known from planning.
//!
//! The displacements of skin and tumour at the phases of the planning 4D-CT are snapshots of one vector.
//! The principal components of the snapshots minus their mean follow from the small matrix of the
//! snapshots' inner products (L. Sirovich, "Turbulence and the dynamics of coherent structures", 1987).
//! As skin and tumour are parts of one vector, a component describes how they move together. Where the
//! tumour lags behind the skin (hysteresis), a second component describes the motion that the first
//! cannot describe.
//!
//! Coefficients are in standard deviations: over the phases each has mean 0 and variance 1, and they
//! are uncorrelated. This is the prior of the [fit](super::MotionTracker).
//!
//! `components` computes the components.

mod components;
#[cfg(test)]
mod tests;

pub use components::ModelOptions;

use components::components;
use glam::{DVec3, Vec3};
use nalgebra::DMatrix;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use phasmid_measure::solid_moments;

/// Maximum number of components: beyond it ten phases of breathing contain only noise.
pub const MOST_COMPONENTS: usize = 6;

/// Displacements from the reference phase to each phase, in millimetres along the room's axes, for
/// the vertices of the reference skin and of the tumour's mesh. The first index is the phase.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Snapshots {
    /// Displacements of the skin's vertices.
    pub skin: Vec<Vec<Vec3>>,
    /// Displacements of the tumour's vertices.
    pub tumour: Vec<Vec<Vec3>>,
}

/// A motion model.
#[derive(Debug, Clone)]
pub struct MotionModel {
    /// Number of components kept.
    count: usize,
    /// Mean displacement of each skin vertex.
    skin_mean: Vec<Vec3>,
    /// Displacements of each skin vertex for a coefficient of 1 of each component.
    skin_modes: Vec<Vec3>,
    /// Skin modes of the components that are left out, as many per vertex as `rest_centroid` has
    /// entries.
    skin_rest: Vec<Vec3>,
    rest_centroid: Vec<DVec3>,
    tumour: Mesh,
    tumour_mean: Vec<Vec3>,
    tumour_modes: Vec<Vec3>,
    energies: Vec<f64>,
    coefficients: Vec<Vec<f64>>,
    /// The tumour's centroid with all coefficients 0.
    centroid: DVec3,
    /// Displacement of the centroid for a coefficient of 1 of each component.
    centroid_modes: Vec<DVec3>,
}

impl MotionModel {
    /// Builds a model from snapshots. `tumour` is the closed mesh at the reference phase, in the room
    /// frame.
    ///
    /// # Errors
    /// Returns an error if there are fewer than two phases, if phases or the tumour differ in their
    /// number of vertices, if a displacement is not finite, if the phases contain no motion, or if
    /// an option is out of range.
    pub fn new(snapshots: &Snapshots, tumour: &Mesh, options: &ModelOptions) -> Result<Self> {
        check(snapshots, tumour, options)?;
        let parts = [&snapshots.skin, &snapshots.tumour];
        let found = components(parts, options)?;
        let count = found.modes;
        let [skin, moving] = found.fields;
        let place = |mean: &[Vec3]| -> Vec<DVec3> {
            let moved = tumour.vertices.iter().zip(mean);
            moved.map(|(v, m)| *v + m.as_dvec3()).collect()
        };
        let at_mean = place(&moving.mean);
        let (_, centroid) = solid_moments(&at_mean, &tumour.triangles);
        // The centroid is nearly linear in the coefficients: central differences with a step of one
        // coefficient err by a third-order term only.
        let slope = |mode: usize, modes: &[Vec3], all: usize| {
            let along = |sign: f64| {
                let moved: Vec<DVec3> = at_mean
                    .iter()
                    .enumerate()
                    .map(|(v, p)| *p + modes[v * all + mode].as_dvec3() * sign)
                    .collect();
                solid_moments(&moved, &tumour.triangles).1
            };
            (along(1.0) - along(-1.0)) / 2.0
        };
        let slopes: Vec<DVec3> = (0..found.all)
            .map(|k| slope(k, &moving.all_modes, found.all))
            .collect();
        Ok(Self {
            count,
            skin_mean: skin.mean,
            skin_modes: some(&skin.all_modes, found.all, 0..count),
            skin_rest: some(&skin.all_modes, found.all, count..found.all),
            rest_centroid: slopes[count..].to_vec(),
            tumour: tumour.clone(),
            tumour_mean: moving.mean,
            tumour_modes: some(&moving.all_modes, found.all, 0..count),
            energies: found.energies,
            coefficients: found.coefficients,
            centroid,
            centroid_modes: slopes[..count].to_vec(),
        })
    }

    /// Returns the number of components kept.
    pub fn components(&self) -> usize {
        self.count
    }

    /// Returns the number of skin vertices.
    pub fn skin_vertices(&self) -> usize {
        self.skin_mean.len()
    }

    /// Returns the fraction of the variance over the phases of each component, including those left
    /// out, largest first.
    pub fn energies(&self) -> &[f64] {
        &self.energies
    }

    /// Returns the coefficients (in standard deviations) of the kept components at each phase of
    /// planning.
    pub fn coefficients(&self) -> &[Vec<f64>] {
        &self.coefficients
    }

    /// Computes the displacement of a skin vertex for given coefficients, in millimetres.
    #[inline]
    pub fn skin(&self, vertex: usize, coefficients: &[f64]) -> Vec3 {
        let modes = &self.skin_modes[vertex * self.count..(vertex + 1) * self.count];
        let moved = modes.iter().zip(coefficients);
        moved.fold(self.skin_mean[vertex], |sum, (m, &c)| sum + *m * c as f32)
    }

    /// Displacements of a skin vertex for a coefficient of 1, component by component.
    #[inline]
    pub(super) fn skin_modes(&self, vertex: usize) -> &[Vec3] {
        &self.skin_modes[vertex * self.count..(vertex + 1) * self.count]
    }

    /// Computes the tumour's mesh for given coefficients, in the reference frame, in millimetres.
    pub fn tumour(&self, coefficients: &[f64]) -> Mesh {
        let mut mesh = self.tumour.clone();
        for (v, p) in mesh.vertices.iter_mut().enumerate() {
            let modes = &self.tumour_modes[v * self.count..(v + 1) * self.count];
            *p += self.tumour_mean[v].as_dvec3();
            for (m, &c) in modes.iter().zip(coefficients) {
                *p += m.as_dvec3() * c;
            }
        }
        mesh
    }

    /// Computes the tumour's centroid for given coefficients, in the reference frame, in millimetres. It
    /// equals the centroid of [`Self::tumour`] as far as that centroid is linear in the vertices.
    pub fn centroid(&self, coefficients: &[f64]) -> DVec3 {
        let moved = self.centroid_modes.iter().zip(coefficients);
        moved.fold(self.centroid, |sum, (m, &c)| sum + *m * c)
    }

    /// Returns the displacement of the tumour's centroid for a coefficient of 1 of each component, in
    /// millimetres.
    pub fn centroid_modes(&self) -> &[DVec3] {
        &self.centroid_modes
    }
}

/// Selects some of the `all` modes of each vertex.
fn some(modes: &[Vec3], all: usize, which: std::ops::Range<usize>) -> Vec<Vec3> {
    modes
        .chunks_exact(all)
        .flat_map(|m| m[which.clone()].iter().copied())
        .collect()
}

fn check(snapshots: &Snapshots, tumour: &Mesh, options: &ModelOptions) -> Result<()> {
    let bad =
        |place: &str, found: String, allowed: String| Err(Error::input(place, found, allowed));
    let phases = snapshots.skin.len();
    if phases < 2 || snapshots.tumour.len() != phases {
        let found = format!(
            "{phases} phases of the skin, {} of the tumour",
            snapshots.tumour.len()
        );
        return bad(
            "motion model",
            found,
            "two or more phases, equally many of both".into(),
        );
    }
    let counts = [snapshots.skin[0].len(), tumour.vertices.len()];
    for (part, fields, count) in [
        ("skin", &snapshots.skin, counts[0]),
        ("tumour", &snapshots.tumour, counts[1]),
    ] {
        for (k, field) in fields.iter().enumerate() {
            let place = format!("motion model: {part} at phase {k}");
            if field.len() != count || count == 0 {
                let found = format!("{} displacements", field.len());
                return bad(&place, found, format!("{count}, one for each vertex"));
            }
            if let Some(v) = field.iter().position(|d| !d.is_finite()) {
                let found = format!("vertex {v} moved by {}", field[v]);
                return bad(&place, found, "finite displacements".into());
            }
        }
    }
    if !(options.energy > 0.0 && options.energy <= 1.0) {
        let found = options.energy.to_string();
        return bad("energy", found, "above 0 to 1".into());
    }
    if !(1..=MOST_COMPONENTS).contains(&options.most) {
        let found = options.most.to_string();
        return bad("components", found, format!("1 to {MOST_COMPONENTS}"));
    }
    Ok(())
}

/// Mean square displacement along the normals, in square millimetres, below which a scan of a
/// thousand points with 0.2 mm of noise does not detect a component.
const UNSEEN_MM2: f64 = 1e-5;

impl MotionModel {
    /// Computes, for a coefficient of 1 of each left-out component, the error of the fitted tumour
    /// centroid, in millimetres. `region` lists the region's vertices with outward normals.
    ///
    /// A left-out component moves the tumour, and it moves the skin, which the fit explains by the
    /// best combination of the kept components. Where a tumour lags behind the skin and no kept
    /// component describes this, the second effect is the larger one.
    pub fn left_out(&self, region: &[(u32, DVec3)]) -> Vec<DVec3> {
        let (kept, rest) = (self.count, self.rest_centroid.len());
        if rest == 0 {
            return Vec::new();
        }
        let mut system = DMatrix::<f64>::zeros(kept, kept);
        let mut right = DMatrix::<f64>::zeros(kept, rest);
        for &(vertex, normal) in region {
            let (v, n) = (vertex as usize, normal.as_vec3());
            let along = |modes: &[Vec3]| -> Vec<f64> {
                modes.iter().map(|m| f64::from(m.dot(n))).collect()
            };
            let (a, b) = (
                along(self.skin_modes(v)),
                along(&self.skin_rest[v * rest..(v + 1) * rest]),
            );
            for i in 0..kept {
                (0..kept).for_each(|j| system[(i, j)] += a[i] * a[j]);
                (0..rest).for_each(|j| right[(i, j)] += a[i] * b[j]);
            }
        }
        // A component that this skin hardly shows is held by its prior instead of compensating for
        // others.
        for i in 0..kept {
            system[(i, i)] += UNSEEN_MM2 * region.len().max(1) as f64;
        }
        let Some(taken_for) = system.cholesky().map(|f| f.solve(&right)) else {
            return self.rest_centroid.clone();
        };
        (0..rest)
            .map(|b| {
                let instead = (0..kept).map(|a| self.centroid_modes[a] * taken_for[(a, b)]);
                self.rest_centroid[b] - instead.sum::<DVec3>()
            })
            .collect()
    }
}
