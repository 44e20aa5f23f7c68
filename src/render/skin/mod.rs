//! Skin: light enters the skin, scatters below the surface, and exits at another point.
//!
//! `tissue` is diffusion theory: diffuse reflectance, contrast of a pattern as a function of spatial
//! frequency, and shift of oblique light. `mixture` approximates the contrast by a sum of Gaussians,
//! which the kernels of the exposure pass combine with the projector's defocus. `preset` holds the
//! Fitzpatrick skin classes, `blood` the absorption of blood.
//!
//! A scene without skin incurs no cost. With skin, the geometry pass computes a kernel for each
//! pixel of lit skin, which takes about half a microsecond each. A kernel takes four bytes per projector
//! pixel (or group of projector pixels, of at most 1024 beyond the footprint) within about four
//! standard deviations of the widest Gaussian: some 200 bytes per pixel and axis for a Fitzpatrick
//! class at 3 projector pixels per millimetre.
//!
//! The surface is assumed to be flat and infinite within the distance that light travels in skin, a
//! few millimetres. Projected light spreads only within the lit area: transport across the edges of
//! the projector's field, of shadows or of the object is neglected. The spread of lamp light is
//! neglected too.

mod blood;
mod mixture;
mod preset;
mod tissue;

use glam::DVec3;
pub(super) use mixture::MOST;
pub use mixture::{Component, Mixture};
use phasmid_geometry::{Pose, View};
use phasmid_profile::{Profile, Scene};
pub use preset::Layers;
use std::sync::Arc;
pub use tissue::Tissue;

/// Tissue index of objects that are not skin.
pub(super) const NONE: u16 = u16::MAX;

/// A tissue of which at least one object consists.
#[derive(Debug)]
pub(super) struct SkinMaterial {
    layers: Layers,
    pub(super) mixture: Mixture,
}

/// The skin of a scene's objects, with the projector that lights it.
pub(super) struct Skins {
    /// Tissue of each object, or [`NONE`].
    of: Vec<u16>,
    pub(super) materials: Arc<[SkinMaterial]>,
    projector: View,
    projector_from_rig: Pose,
}

/// Light transport under the skin at one point, in pattern coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scatter {
    /// Pattern columns, and pattern rows, per millimetre of the surface, each along its gradient at
    /// the point.
    pub(super) px_per_mm: [f32; 2],
    /// Offset, in projector pixels, from the point to where the light seen at the point entered the
    /// surface.
    pub(super) shift_px: [f32; 2],
    /// Index of the tissue.
    pub(super) tissue: u16,
}

impl Skins {
    pub(super) fn new(profile: &Profile, scene: &Scene) -> Self {
        let mut materials: Vec<SkinMaterial> = Vec::new();
        let wavelength = profile.projector.wavelength_nm;
        let mut index = |layers: Layers| {
            let known = materials.iter().position(|m| m.layers == layers);
            let index = known.unwrap_or_else(|| {
                materials.push(SkinMaterial {
                    layers,
                    mixture: Mixture::new(&layers.tissue),
                });
                materials.len() - 1
            });
            index as u16
        };
        let mut of = Vec::new();
        for object in &scene.object {
            let layers = object.skin.map(|skin| Layers::new(&skin, wavelength));
            of.push(layers.map_or(NONE, &mut index));
        }
        let projector = profile.projector.view();
        Self {
            of,
            materials: materials.into(),
            projector,
            projector_from_rig: projector.rig_from_view.inverse(),
        }
    }

    pub(super) fn any(&self) -> bool {
        !self.materials.is_empty()
    }

    /// Returns the mixtures of all tissues, by tissue index.
    pub(super) fn mixtures(&self) -> impl Iterator<Item = &Mixture> {
        self.materials.iter().map(|material| &material.mixture)
    }

    /// Returns for each object the index of its tissue, or [`NONE`], and the shift in millimetres
    /// that its skin gives to light at grazing incidence.
    pub(super) fn of_objects(&self) -> impl Iterator<Item = (u16, f64)> {
        self.of.iter().map(|&tissue| {
            let material = self.materials.get(usize::from(tissue));
            (
                tissue,
                material.map_or(0.0, |m| m.layers.tissue.shift_mm(1.0)),
            )
        })
    }

    /// Returns the reflectance of an object's skin under uniform light; `None` if the object is not
    /// skin.
    pub(super) fn reflectance(&self, object: usize) -> Option<f64> {
        let material = self.materials.get(usize::from(*self.of.get(object)?))?;
        Some(material.layers.reflectance())
    }

    /// Returns the light transport under the skin at a point of an object; `None` if the object is
    /// not skin. The point and the unit normal there are in the rig's frame.
    pub(super) fn at(&self, object: u16, point: DVec3, normal: DVec3) -> Option<Scatter> {
        let tissue = self.of[usize::from(object)];
        let material = self.materials.get(usize::from(tissue))?;
        // Component of the direction along the surface; its length is the sine of the angle of
        // incidence.
        let way = (point - self.projector.center()).normalize();
        let along = way - normal * normal.dot(way);
        // Light that exits at the point entered the skin this far back along its direction.
        let shift = -along * material.layers.tissue.shift_mm(1.0);
        let gradients = self.gradients(point);
        let on_surface = gradients.map(|g| (g - normal * normal.dot(g)).length() as f32);
        Some(Scatter {
            px_per_mm: on_surface,
            shift_px: gradients.map(|g| g.dot(shift) as f32),
            tissue,
        })
    }

    /// Returns the gradients of the projector's column and row with respect to a point in the rig's
    /// frame, in 1/mm.
    fn gradients(&self, point: DVec3) -> [DVec3; 2] {
        let lens = &self.projector.lens;
        let p = self.projector_from_rig.point(point);
        let ideal = p.truncate() / p.z;
        let bent = lens.distort_jacobian(ideal);
        let by = [
            DVec3::new(1.0, 0.0, -ideal.x) / p.z,
            DVec3::new(0.0, 1.0, -ideal.y) / p.z,
        ];
        [0, 1].map(|axis| {
            let local = by[0] * bent.x_axis[axis] + by[1] * bent.y_axis[axis];
            let gradient = local * lens.focal_px[axis];
            self.projector.rig_from_view.direction(gradient)
        })
    }
}
