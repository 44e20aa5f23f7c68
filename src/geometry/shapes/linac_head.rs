//! The head of a C-arm linear accelerator and its gantry, which rotate around the patient and can
//! block the view between the skin and the scanner's pods.
//!
//! Frame: unlike the other shapes, it is defined in the fixed frame of IEC 61217 with the origin at
//! the isocentre, at a gantry angle of 0: the head above the patient (z up), the drum behind it (y
//! to the gantry). A gantry angle is a right-handed rotation about y, as in the standard: at 90
//! degrees the head is at +x.
//!
//! It models no particular product. The lower face of the collimator is 420 mm above the isocentre
//! (400 to 450 mm on common machines), the head is 800 mm wide, and the drum starts 950 mm behind
//! the isocentre.

use super::loft::loft;
use crate::Mesh;
use glam::DVec3;

/// Number of points per ring.
const AROUND: usize = 96;

/// A cross-section: position along the part's axis and half widths across it, in millimetres.
type Ring = (f64, [f64; 2]);

/// A part: rings along an axis, with an outline between an ellipse and a rectangle.
struct Part {
    /// Whether the axis is y; if not, it is z.
    along_y: bool,
    /// Position of the axis: x and z if along y, x and y if along z.
    middle: [f64; 2],
    /// Exponent of the Lame curve: 2 for an ellipse, larger for a rounded rectangle.
    exponent: f64,
    rings: &'static [Ring],
}

/// The parts of the head, in order from the patient outwards, then back to the drum. They overlap so
/// that there are no gaps; their edges are chamfered.
const PARTS: [Part; 4] = [
    // Collimator: it rotates about the beam, so it is round.
    Part {
        along_y: false,
        middle: [0.0, 0.0],
        exponent: 2.0,
        rings: &[
            (420.0, [270.0; 2]),
            (435.0, [290.0; 2]),
            (540.0, [300.0; 2]),
            (640.0, [300.0; 2]),
        ],
    },
    // Housing of the head.
    Part {
        along_y: false,
        middle: [0.0, 0.0],
        exponent: 5.0,
        rings: &[
            (600.0, [340.0; 2]),
            (660.0, [400.0; 2]),
            (900.0, [400.0; 2]),
            (1180.0, [400.0; 2]),
            (1250.0, [340.0; 2]),
        ],
    },
    // Arm from the head to the drum.
    Part {
        along_y: true,
        middle: [0.0, 930.0],
        exponent: 5.0,
        rings: &[
            (300.0, [300.0, 250.0]),
            (650.0, [310.0, 260.0]),
            (1050.0, [330.0, 280.0]),
        ],
    },
    // Drum, around the axis of rotation.
    Part {
        along_y: true,
        middle: [0.0, 0.0],
        exponent: 2.0,
        rings: &[
            (950.0, [1180.0; 2]),
            (980.0, [1230.0; 2]),
            (1200.0, [1230.0; 2]),
            (1420.0, [1230.0; 2]),
            (1450.0, [1180.0; 2]),
        ],
    },
];

/// Generates the head as overlapping closed parts.
pub fn linac_head() -> Mesh {
    let mut whole = Mesh::default();
    for part in &PARTS {
        let mesh = part.mesh();
        let first = whole.vertices.len() as u32;
        whole.vertices.extend(mesh.vertices);
        let shifted = mesh.triangles.into_iter().map(|t| t.map(|i| i + first));
        whole.triangles.extend(shifted);
    }
    whole
}

impl Part {
    fn mesh(&self) -> Mesh {
        loft(self.rings.len(), AROUND, |ring, k| self.point(ring, k))
    }

    fn point(&self, ring: usize, k: usize) -> DVec3 {
        let (along, half) = self.rings[ring];
        let angle = std::f64::consts::TAU * k as f64 / AROUND as f64;
        let power = 2.0 / self.exponent;
        let bent = |v: f64| v.abs().powf(power).copysign(v);
        let across = [angle.cos(), angle.sin()].map(bent);
        let [a, b] = std::array::from_fn(|i| half[i] * across[i]);
        let [u, v] = self.middle;
        // Counter-clockwise as seen from the last ring, as `loft` requires.
        match self.along_y {
            true => DVec3::new(u + a, along, v - b),
            false => DVec3::new(u + a, v + b, along),
        }
    }
}

#[cfg(all(test, feature = "raycast"))]
mod tests {
    use super::super::check;
    use super::*;
    use crate::MeshTree;

    #[test]
    fn every_part_is_closed_and_faces_outward() {
        for part in &PARTS {
            check::closed(&part.mesh());
        }
        let mesh = linac_head();
        check::closed(&mesh);
        let (lo, hi) = mesh.bounds().unwrap();
        // Back and lowest point of the drum.
        assert_eq!((hi.y, lo.z), (1450.0, -1230.0));
        // The head starts above the patient and is 800 mm wide.
        let head = mesh.vertices.iter().filter(|v| v.y < 299.0);
        let (low, wide) = head.fold((f64::INFINITY, 0.0_f64), |(low, wide), v| {
            (low.min(v.z), wide.max(v.x.abs()))
        });
        assert!((400.0..=450.0).contains(&low), "{low}");
        assert_eq!(wide, 400.0);
        // The isocentre is clear at all angles: the collimator's face is the closest part.
        let near = MeshTree::new(&mesh).closest(DVec3::ZERO).unwrap();
        assert!((near.point.length() - 420.0).abs() < 1e-9);
    }
}
