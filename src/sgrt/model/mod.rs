//! How a patient moves: principal components of the displacements that planning has seen.
//!
//! The displacements of skin and tumour at the phases of the planning 4D-CT are snapshots of one
//! vector; less their mean, its principal components are found from the small matrix of the
//! snapshots' products (L. Sirovich, "Turbulence and the dynamics of coherent structures", 1987). As
//! skin and tumour are parts of one vector, a component says how they move together. Where the tumour
//! lags behind the skin (hysteresis), a second component has what the first cannot say.
//!
//! Coefficients are in deviations: over the phases each has mean 0 and variance 1, and they do not
//! correlate. That is the prior of the [fit](super::MotionTracker).

mod components;
mod left_out;
#[cfg(test)]
mod tests;

use components::components;
use glam::{DVec3, Vec3};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use phasmid_measure::solid_moments;

/// Components at most: ten phases of breathing do not hold more than noise beyond.
pub const MOST_COMPONENTS: usize = 6;

/// Displacements in millimetres along the room's axes from the reference phase to each phase, phase
/// by phase, of the vertices of the reference skin and of the tumour's mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Snapshots {
    /// Of the skin's vertices.
    pub skin: Vec<Vec<Vec3>>,
    /// Of the tumour's vertices.
    pub tumour: Vec<Vec<Vec3>>,
}

/// How to choose components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelOptions {
    /// Share of the variance over the phases that components have to make up, 0 to 1. A lag of a
    /// tenth of a breath between skin and tumour is less than a hundredth of the variance and
    /// millimetres of the tumour, so this is near 1.
    pub energy: f64,
    /// Components at most, 1 to 6.
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

/// A motion model.
#[derive(Debug, Clone)]
pub struct MotionModel {
    /// Components kept.
    count: usize,
    /// Of each skin vertex the mean displacement and those of the components for a coefficient of 1.
    skin_mean: Vec<Vec3>,
    skin_modes: Vec<Vec3>,
    /// The same of the components that are left out, of which there are as many as `rest_centroid`.
    skin_rest: Vec<Vec3>,
    rest_centroid: Vec<DVec3>,
    tumour: Mesh,
    tumour_mean: Vec<Vec3>,
    tumour_modes: Vec<Vec3>,
    energies: Vec<f64>,
    coefficients: Vec<Vec<f64>>,
    /// Where the tumour's centroid is with all coefficients 0, and what each does to it.
    centroid: DVec3,
    centroid_modes: Vec<DVec3>,
}

impl MotionModel {
    /// Learns from snapshots. `tumour` is the closed mesh at the reference phase, in the room frame.
    ///
    /// # Errors
    /// Fewer than two phases, phases of different lengths, a tumour of another number of vertices, a
    /// displacement that is not finite, no motion at all, options out of range.
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
        // The centroid is very nearly linear in the vertices: differences over a whole coefficient,
        // both ways, leave a third of its cubic part.
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

    /// How many components are kept.
    pub fn components(&self) -> usize {
        self.count
    }

    /// How many vertices of the skin it moves.
    pub fn skin_vertices(&self) -> usize {
        self.skin_mean.len()
    }

    /// Share of the variance over the phases of each component, those left out too, the largest
    /// first.
    pub fn energies(&self) -> &[f64] {
        &self.energies
    }

    /// Coefficients of the kept components at each phase of planning, in deviations.
    pub fn coefficients(&self) -> &[Vec<f64>] {
        &self.coefficients
    }

    /// Displacement of a skin vertex for some coefficients, in millimetres.
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

    /// The tumour's mesh for some coefficients, in the frame of the reference, in millimetres.
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

    /// The tumour's centroid for some coefficients, in the frame of the reference, in millimetres;
    /// that of [`Self::tumour`] to the extent that a volume's centroid is linear in its vertices.
    pub fn centroid(&self, coefficients: &[f64]) -> DVec3 {
        let moved = self.centroid_modes.iter().zip(coefficients);
        moved.fold(self.centroid, |sum, (m, &c)| sum + *m * c)
    }

    /// What a coefficient of 1 does to the tumour's centroid, component by component, in millimetres.
    pub fn centroid_modes(&self) -> &[DVec3] {
        &self.centroid_modes
    }
}

/// Some of `all` modes of each vertex.
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
        return bad("motion model", found, "two phases or more of both".into());
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
