//! Reflected light of a surface, treated as uniform over all directions.

use super::Materials;
use super::ggx::Ggx;
use crate::world::{Surface, World};
use crate::{Plan, Term};
use glam::DVec3;

/// A surface point, and the sides of a patch around it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patch {
    /// In the rig's frame in millimetres.
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

    /// Returns the fraction of light from a direction at this cosine to the normal that is
    /// reflected, diffuse part and lobe together, so that energy is conserved.
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
