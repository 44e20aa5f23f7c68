//! Hounsfield units of the phantom: tissues by organ, blended across borders of some millimetres to
//! model partial volumes.
//!
//! Values are from textbooks (Kalender, "Computed Tomography", 2011, fig. 1.12): air -1000, lung
//! about -750 at end-exhale, fat -100, organs 20 to 60, bone some hundreds. Lung conserves its
//! mass: where it is stretched, its density decreases.

use super::organs::Organs;
use super::skin::Skin;
use super::tumour::Shape;
use glam::DVec3;

const AIR: f64 = -1000.0;
/// Skin has 0, so that its border with air is at -500.
const SKIN: f64 = 0.0;
const FAT: f64 = -100.0;
const MUSCLE: f64 = 50.0;
const VISCERA: f64 = 20.0;
const LIVER: f64 = 58.0;
const HEART: f64 = 42.0;
const TUMOUR: f64 = 38.0;
const RIB: f64 = 350.0;
const SPINE: f64 = 220.0;
/// Mass density of lung relative to water at the reference phase.
const LUNG_DENSITY: f64 = 0.25;
/// Minimum half width of a border, which suits the finest voxels.
pub(super) const BORDER_MM: f64 = 1.0;
/// Thickness of the skin.
const SKIN_MM: f64 = 2.0;

/// A point at the reference phase.
pub(super) struct Place {
    /// Position in the body frame.
    pub(super) x: DVec3,
    /// Current volume relative to the volume at the reference phase.
    pub(super) stretched: f64,
}

/// Returns the Hounsfield units at a point; borders extend `border_mm` to either side.
pub(super) fn value(
    (skin, organs, tumour): (&Skin, &Organs, &Shape),
    &Place { x, stretched }: &Place,
    border_mm: f64,
) -> f64 {
    let outside = skin.outside(x);
    if outside >= border_mm {
        return AIR;
    }
    let mut value = FAT;
    let mut lay = |hounsfield: f64, outside: f64| {
        let share = (0.5 - 0.5 * outside / border_mm).clamp(0.0, 1.0);
        value += share * (hounsfield - value);
    };
    lay(MUSCLE, skin.outside_core(x));
    let wall = organs.wall(x);
    if wall < border_mm {
        lay(VISCERA, wall);
        lay(LIVER, organs.liver(x));
        lay(HEART, organs.between(x).max(organs.diaphragm(x)));
        let lungs = organs.lungs(x);
        lay(1000.0 * (LUNG_DENSITY / stretched - 1.0), lungs);
        lay(SPINE, organs.spine(x));
        // Only lungs contain tumours.
        lay(TUMOUR, tumour.outside(x));
    } else if wall < 20.0 {
        lay(RIB, organs.ribs(x));
        lay(SPINE, organs.spine(x));
    }
    lay(SKIN, -outside - SKIN_MM);
    lay(AIR, -outside);
    value
}
