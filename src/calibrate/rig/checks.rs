//! Comparison of a result with the device's nominal rig. A wrong board size scales every length,
//! which the calibration data alone cannot reveal.

use phasmid_geometry::{Rig, View};

/// Accepted ratio of calibrated to nominal values: how far a real rig may differ from its design.
const ALLOWED: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// Returns warnings about baseline and focal lengths that differ from nominal by more than the
/// tolerance.
pub(super) fn against_nominal(rig: &Rig, nominal: &Rig) -> Vec<String> {
    let mut warnings = Vec::new();
    let baseline = |rig: &Rig| (rig.projector.center() - rig.camera.center()).length();
    let (found, wanted) = (baseline(rig), baseline(nominal));
    let factor = found / wanted;
    if !ALLOWED.contains(&factor) {
        warnings.push(format!(
            "the baseline is {found:.2} mm, {factor:.3} times the nominal {wanted:.2} mm (0.9 to \
             1.1 are usual): a board whose real pitch is {:.3} times the specified one would cause \
             this",
            1.0 / factor
        ));
    }
    for (name, found, wanted) in [
        ("camera", &rig.camera, &nominal.camera),
        ("projector", &rig.projector, &nominal.projector),
    ] {
        warnings.extend(focal_lengths(name, found, wanted));
    }
    warnings
}

fn focal_lengths(name: &str, found: &View, wanted: &View) -> Option<String> {
    let (found, wanted) = (found.lens.focal_px, wanted.lens.focal_px);
    let factor = found / wanted;
    let usual = ALLOWED.contains(&factor.x) && ALLOWED.contains(&factor.y);
    (!usual).then(|| {
        format!(
            "the {name}'s focal lengths are {:.1} and {:.1} px, {:.3} and {:.3} times the nominal \
             ones (0.9 to 1.1 are usual): another lens or zoom, or poses that do not determine them",
            found.x, found.y, factor.x, factor.y
        )
    })
}
