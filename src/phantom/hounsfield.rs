//! What a CT would measure: tissues by their organs, borders shared over some millimetres, as voxels
//! that a border crosses are part of both.
//!
//! Values are those of textbooks (Kalender, "Computed Tomography", 2011, fig. 1.12): air -1000, lung
//! about -750 at end-exhale, fat -100, organs 20 to 60, bone some hundreds. Lung keeps its mass: where
//! it is stretched to more volume, it is thinner.

use super::organs::Organs;
use super::skin::Skin;
use super::tumour::Shape;
use glam::DVec3;

const AIR: f64 = -1000.0;
/// Skin has 0, so that the border with air is at -500.
const SKIN: f64 = 0.0;
const FAT: f64 = -100.0;
const MUSCLE: f64 = 50.0;
const VISCERA: f64 = 20.0;
const LIVER: f64 = 58.0;
const HEART: f64 = 42.0;
const TUMOUR: f64 = 38.0;
const RIB: f64 = 350.0;
const SPINE: f64 = 220.0;
/// Lung's mass over water's of the same volume at the reference phase.
const LUNG_DENSITY: f64 = 0.25;
/// Least half width of a border: that of the finest voxels.
pub(super) const BORDER_MM: f64 = 1.0;
/// How thick the skin is.
const SKIN_MM: f64 = 2.0;

/// A place of the reference phase.
pub(super) struct Place {
    /// Where it is, in the body frame.
    pub(super) x: DVec3,
    /// How many times itself a volume there has become.
    pub(super) stretched: f64,
}

/// Hounsfield units at a place; borders are `border_mm` wide to either side.
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
        // Only lungs have it.
        lay(TUMOUR, tumour.outside(x));
    } else if wall < 20.0 {
        lay(RIB, organs.ribs(x));
        lay(SPINE, organs.spine(x));
    }
    lay(SKIN, -outside - SKIN_MM);
    lay(AIR, -outside);
    value
}
