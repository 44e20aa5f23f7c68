//! The light of projector and lamps on a patch of surface that some ray has met.

use crate::look::{Evenly, Patch};
use crate::shade::Optics;
use crate::{Plan, Term};
use glam::{DMat2, DVec2};

/// A patch in the projector's field, shadows aside.
pub(super) struct Shown {
    /// Place on the slide.
    pub(super) px: DVec2,
    /// Sides of the patch there.
    pub(super) sides: [DVec2; 2],
    /// What it throws back under full white in W/m^2.
    pub(super) thrown_back: f64,
}

/// Where on the slide a patch is lit from, and what it throws back; `None` outside of the field and
/// on the far side.
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
    // NaN, of a point in the pupil itself, is not lit.
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
