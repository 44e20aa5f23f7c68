//! Skin: light enters, travels under the surface, and comes out elsewhere.
//!
//! `tissue` is diffusion theory: how much comes back, how much contrast a pattern keeps at its
//! frequency on the surface, how far oblique light is shifted. `mixture` puts the contrast as a sum
//! of Gaussians, which the kernels of the exposure pass take together with the projector's
//! defocus. `preset` has the classes of Fitzpatrick's scale, `blood` what colours them. `maps` is
//! what the geometry pass leaves of it.
//!
//! It costs a scene without skin nothing. With it, the geometry pass works out a kernel for each
//! pixel of lit skin, some microseconds each, and a kernel takes four bytes a slide pixel (or group
//! of them, of at most 1024 beyond the footprint) within about four of the widest Gaussian's
//! standard deviations: some 200 bytes a pixel and axis for a class of Fitzpatrick's scale at 3
//! slide pixels a millimetre.
//!
//! The surface is assumed flat and infinite within the range of light transport, a few millimetres.
//! Pattern light spreads within its field; transport across edges of the field, of shadows or of
//! the object is neglected, as is the spread of lamp light.

mod blood;
mod maps;
mod mixture;
mod preset;
mod tissue;

use glam::DVec3;
pub(super) use maps::{Samples, SkinMaps, into_sample};
pub(super) use mixture::MOST;
pub use mixture::{Component, Mixture};
use phasmid_geometry::{Pose, View};
use phasmid_profile::{Profile, Scene};
pub use preset::Layers;
use std::sync::Arc;
pub use tissue::Tissue;

/// Index of no tissue.
pub(super) const NONE: u16 = u16::MAX;

/// A tissue that some object is made of.
#[derive(Debug)]
pub(super) struct Material {
    layers: Layers,
    pub(super) mixture: Mixture,
}

/// The skins of a scene before a projector.
pub(super) struct Skins {
    /// Tissue of each object, or [`NONE`].
    of: Vec<u16>,
    materials: Arc<[Material]>,
    projector: View,
    projector_from_rig: Pose,
}

/// Subsurface transport at one point of skin, in pattern coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scatter {
    /// Columns and rows of the slide a millimetre of the surface, along their gradients there.
    pub(super) px_per_mm: [f32; 2],
    /// From where the point is lit to where its light entered, in slide pixels.
    pub(super) shift_px: [f32; 2],
    /// Index of the tissue.
    pub(super) tissue: u16,
}

impl Skins {
    pub(super) fn new(profile: &Profile, scene: &Scene) -> Self {
        let mut materials: Vec<Material> = Vec::new();
        let wavelength = profile.projector.wavelength_nm;
        let mut index = |layers: Layers| {
            let known = materials.iter().position(|m| m.layers == layers);
            let index = known.unwrap_or_else(|| {
                materials.push(Material {
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

    /// The mixtures of all tissues, by their indices.
    pub(super) fn mixtures(&self) -> impl Iterator<Item = &Mixture> {
        self.materials.iter().map(|material| &material.mixture)
    }

    /// Of each object the index of its tissue, or [`NONE`], and how far light emerges that comes in
    /// along the surface, in millimetres.
    pub(super) fn of_objects(&self) -> impl Iterator<Item = (u16, f64)> {
        self.of.iter().map(|&tissue| {
            let material = self.materials.get(usize::from(tissue));
            (
                tissue,
                material.map_or(0.0, |m| m.layers.tissue.shift_mm(1.0)),
            )
        })
    }

    /// Reflectance of an object's skin under even light; `None` where it has none.
    pub(super) fn reflectance(&self, object: usize) -> Option<f64> {
        let material = self.materials.get(usize::from(*self.of.get(object)?))?;
        Some(material.layers.reflectance())
    }

    /// What light does under a point of an object, with its unit normal, both in the rig's frame.
    fn at(&self, object: u16, point: DVec3, normal: DVec3) -> Option<Scatter> {
        let tissue = self.of[usize::from(object)];
        let material = self.materials.get(usize::from(tissue))?;
        // Along the surface, as long as the sine of the angle of incidence.
        let way = (point - self.projector.center()).normalize();
        let along = way - normal * normal.dot(way);
        // Light that emerges here came in this much earlier on its way.
        let shift = -along * material.layers.tissue.shift_mm(1.0);
        let gradients = self.gradients(point);
        let on_surface = gradients.map(|g| (g - normal * normal.dot(g)).length() as f32);
        Some(Scatter {
            px_per_mm: on_surface,
            shift_px: gradients.map(|g| g.dot(shift) as f32),
            tissue,
        })
    }

    /// Gradients of the projector's column and row by a point in the rig's frame, in 1/mm.
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
