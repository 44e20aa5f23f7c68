//! Projector and lamp light on a surface patch hit by a ray.

use crate::material::{Evenly, Patch};
use crate::shade::Optics;
use crate::{Plan, Term};
use glam::{DMat2, DVec2};

/// A patch in the projector's field, regardless of shadows.
pub(super) struct Shown {
    /// Position in the pattern in projector pixels.
    pub(super) px: DVec2,
    /// Sides of the patch in the pattern.
    pub(super) sides: [DVec2; 2],
    /// Radiant exitance under full white in W/m^2.
    pub(super) thrown_back: f64,
}

/// Returns the projector position that lights a patch and the patch's exitance; `None` outside the
/// field and if the patch faces away.
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
    // A point in the pupil itself gives NaN and counts as unlit.
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
