//! Patches of surfaces that rays hit: their reflectance, for which incident light is treated as
//! uniform over all directions, and the projector's light on them.

use crate::exposure::Optics;
use crate::material::{Ggx, Materials};
use crate::scene::{Surface, World};
use crate::{Plan, Term};
use glam::{DMat2, DVec2, DVec3};

/// A surface point, and the sides of a patch around it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patch {
    /// Point in the rig's frame in millimetres.
    pub(crate) point: DVec3,
    /// Unit normal of the facet.
    pub(crate) normal: DVec3,
    pub(crate) surface: Surface,
    pub(crate) sides: [DVec3; 2],
}

/// The material of a patch.
pub(crate) struct Evenly<'a> {
    albedo: f64,
    specular: Option<&'a Ggx>,
}

impl Evenly<'_> {
    /// Returns the fraction of light that is reflected diffusely.
    pub(crate) fn albedo(&self) -> f64 {
        self.albedo
    }

    /// Returns the fraction that is reflected, by diffuse base and lobe together, of light from a
    /// direction at this cosine to the normal. Energy is conserved.
    pub(crate) fn share(&self, cos: f64) -> f64 {
        match self.specular {
            Some(ggx) => ggx.under_even_light(self.albedo, cos),
            None => self.albedo,
        }
    }
}

impl Materials {
    /// Returns the material of a patch, with its albedo averaged over the patch.
    pub(crate) fn evenly(&self, plan: &Plan, world: &World, patch: &Patch) -> Evenly<'_> {
        let material = &self.of[usize::from(world.object(patch.surface))];
        let mut albedo = material.albedo;
        if plan.has(Term::AlbedoMaps) && material.varies() {
            albedo *= material.factor(world, patch.surface, patch.point, patch.normal, patch.sides);
        }
        Evenly {
            albedo,
            specular: material
                .specular
                .as_deref()
                .filter(|_| plan.has(Term::Specular)),
        }
    }
}

/// A patch in the projector's field, whether or not it is in shadow.
pub(super) struct Shown {
    /// Position of the point in the pattern, in projector pixels.
    pub(super) px: DVec2,
    /// Sides of the patch in the pattern, in projector pixels.
    pub(super) sides: [DVec2; 2],
    /// Radiant exitance of the patch under full white in W/m^2.
    pub(super) thrown_back: f64,
}

/// Returns the projector position that lights a patch, and the patch's exitance; `None` if the patch
/// is outside the projector's field or faces away from the projector.
pub(super) fn shown(
    optics: &Optics,
    plan: &Plan,
    patch: &Patch,
    evenly: &Evenly<'_>,
) -> Option<Shown> {
    let view = &optics.projector;
    let (lens, way) = (&view.lens, patch.point - view.center());
    let axes = view.rig_from_view.rotation.transpose();
    let local = axes * way;
    let distance2 = way.length_squared();
    let cos = -patch.normal.dot(way) / distance2.sqrt();
    // A point in the pupil itself gives NaN, so it counts as unlit.
    if !(local.z > 0.0 && cos > 0.0) {
        return None;
    }
    let ideal = local.truncate() / local.z;
    let (px, bent) = if plan.has(Term::ProjectorDistortion) {
        (lens.place(ideal)?, lens.distort_jacobian(ideal))
    } else {
        let px = lens.focal_px * ideal + lens.principal_px;
        (px, DMat2::IDENTITY)
    };
    if !lens.contains(px) {
        return None;
    }
    let mut irradiance = optics.irradiance_w_m2(cos, distance2);
    if plan.has(Term::ProjectorVignetting) {
        irradiance *= optics.shown.at(ideal);
    }
    let sides = patch.sides.map(|side| {
        let side = axes * side;
        lens.focal_px * (bent * ((side.truncate() - ideal * side.z) / local.z))
    });
    Some(Shown {
        px,
        sides,
        thrown_back: evenly.share(cos) * irradiance,
    })
}
