//! The top of a treatment couch: thin, long, with rounded edges and corners, slightly hollow on
//! top, and with notches along both sides to which fixation devices are indexed.

use super::loft::loft;
use super::{Violation, clamped, within};
use crate::Mesh;
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;
use std::ops::RangeInclusive;

/// Parameters of a couch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Couch {
    /// Size along x, 100 to 5000 mm. Clinical table tops are 500 to 530 mm wide.
    pub width_mm: f64,
    /// Size along y, 100 to 5000 mm.
    pub length_mm: f64,
    /// Size along z, 10 to 90 mm.
    pub thickness_mm: f64,
    /// Depth of the middle of the top below its sides, 0 to 4 mm.
    pub hollow_mm: f64,
    /// Distance between notches, 50 to 1000 mm; indexing bars use 140 mm.
    pub notch_spacing_mm: f64,
    /// Depth of the notches, 0 to 20 mm.
    pub notch_depth_mm: f64,
    /// Number of triangles, 2000 to 4,000,000; from 20,000 on, the mesh has this number to within 25 %.
    /// The notches and roundings need about 6,000, so smaller values also give about 6,000.
    pub triangles: u32,
}

impl Default for Couch {
    fn default() -> Self {
        Self {
            width_mm: 530.0,
            length_mm: 900.0,
            thickness_mm: 50.0,
            hollow_mm: 3.0,
            notch_spacing_mm: 140.0,
            notch_depth_mm: 12.0,
            triangles: 40_000,
        }
    }
}

const SIDES_MM: RangeInclusive<f64> = 100.0..=5000.0;
const THICKNESS_MM: RangeInclusive<f64> = 10.0..=90.0;
const HOLLOW_MM: RangeInclusive<f64> = 0.0..=4.0;
const SPACING_MM: RangeInclusive<f64> = 50.0..=1000.0;
const NOTCH_MM: RangeInclusive<f64> = 0.0..=20.0;
const TRIANGLES: RangeInclusive<f64> = 2000.0..=4e6;

/// Radius of the corners in plan view.
const CORNER_MM: f64 = 45.0;
/// Half the length of a notch, measured at about half of the notch's depth.
const NOTCH_HALF_MM: f64 = 12.0;
/// Number of points on each of the four rounded edges of a cross-section.
const ARC: usize = 8;
/// Number of rings over each rounded end.
const END: usize = 24;

impl Couch {
    /// Checks that the parameters are in range.
    ///
    /// # Errors
    /// Returns the first field out of range.
    pub fn check(&self) -> Result<(), Violation> {
        within("width_mm", self.width_mm, SIDES_MM)?;
        within("length_mm", self.length_mm, SIDES_MM)?;
        within("thickness_mm", self.thickness_mm, THICKNESS_MM)?;
        within("hollow_mm", self.hollow_mm, HOLLOW_MM)?;
        within("notch_spacing_mm", self.notch_spacing_mm, SPACING_MM)?;
        within("notch_depth_mm", self.notch_depth_mm, NOTCH_MM)?;
        within("triangles", f64::from(self.triangles), TRIANGLES)
    }
}

/// Generates a couch. Parameters that [`Couch::check`] rejects are clamped to their ranges.
pub fn couch(params: &Couch) -> Mesh {
    let shape = Couch {
        width_mm: clamped(params.width_mm, SIDES_MM),
        length_mm: clamped(params.length_mm, SIDES_MM),
        thickness_mm: clamped(params.thickness_mm, THICKNESS_MM),
        hollow_mm: clamped(params.hollow_mm, HOLLOW_MM),
        notch_spacing_mm: clamped(params.notch_spacing_mm, SPACING_MM),
        notch_depth_mm: clamped(params.notch_depth_mm, NOTCH_MM),
        triangles: params.triangles,
    };
    let triangles = clamped(f64::from(params.triangles), TRIANGLES);
    // The notches determine the number of rings; the remaining triangles go across.
    let rings = ((triangles / 2.0).sqrt() * 1.5).max(3.0 * END as f64) as usize;
    let across = ((triangles / rings as f64 / 2.0 - 4.0 * ARC as f64) / 2.0).max(4.0) as usize;
    let stations = stations(&shape, rings);
    let outline = section(across);
    loft(stations.len(), outline.len(), |ring, k| {
        shape.surface(&stations[ring], &outline[k])
    })
}

/// Position of a cross-section along y, and how far its outline is set back from that of the full
/// cross-section.
struct Station {
    y: f64,
    side: f64,
    face: f64,
}

/// Rings along y: evenly spaced in the middle, by angle over the rounded ends, so that no ring is
/// degenerate.
fn stations(shape: &Couch, rings: usize) -> Vec<Station> {
    let half = shape.length_mm / 2.0;
    let edge = shape.edge_mm();
    let middle = rings - 2 * END;
    let end = |k: usize| {
        let angle = FRAC_PI_2 * k as f64 / END as f64;
        // The end face stays flat: all but the last few degrees are rounded.
        let y = CORNER_MM * angle.sin();
        let beyond = y - (CORNER_MM - edge);
        let face = if beyond > 0.0 {
            edge - (edge * edge - beyond * beyond).max(0.0).sqrt()
        } else {
            0.0
        };
        Station {
            y: half - CORNER_MM + y,
            side: CORNER_MM * (1.0 - angle.cos()),
            face,
        }
    };
    let mut all: Vec<Station> = (0..=END).rev().map(end).collect();
    all.iter_mut().for_each(|s| s.y = -s.y);
    let straight = 2.0 * (half - CORNER_MM);
    all.extend((1..middle).map(|k| {
        let y = straight * (k as f64 / middle as f64 - 0.5);
        Station {
            y,
            side: shape.notch(y),
            face: 0.0,
        }
    }));
    all.extend((0..=END).map(end));
    all
}

/// A point of a cross-section: its corner's centre (as fractions of half the width and of the
/// thickness) and its direction on the rounded edge.
struct Point {
    across: f64,
    up: f64,
    round: (f64, f64),
}

/// The outline, starting over the top and returning below, with `across` segments on either face.
fn section(across: usize) -> Vec<Point> {
    let mut points = Vec::with_capacity(2 * across + 4 * ARC);
    // Corners in order: right top, left top, left bottom, right bottom.
    for (corner, (across_sign, up)) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, 0.0), (1.0, 0.0)]
        .into_iter()
        .enumerate()
    {
        for k in 0..=ARC {
            let angle = FRAC_PI_2 * (corner as f64 + k as f64 / ARC as f64);
            points.push(Point {
                across: across_sign,
                up,
                round: (angle.cos(), angle.sin()),
            });
        }
        if corner.is_multiple_of(2) {
            let rise = if corner == 0 { 1.0 } else { -1.0 };
            points.extend((1..across).map(|k| Point {
                across: across_sign * (1.0 - 2.0 * k as f64 / across as f64),
                up,
                round: (0.0, rise),
            }));
        }
    }
    points
}

impl Couch {
    /// Radius of the rounded edges of a cross-section.
    fn edge_mm(&self) -> f64 {
        (self.thickness_mm * 0.3).min(15.0)
    }

    /// Depth of the notches at y: there is a smooth notch at each multiple of the spacing, except near
    /// the ends.
    fn notch(&self, y: f64) -> f64 {
        let spacing = self.notch_spacing_mm;
        let nearest = (y / spacing).round() * spacing;
        let room = self.length_mm / 2.0 - CORNER_MM - 4.0 * NOTCH_HALF_MM;
        if nearest.abs() > room {
            return 0.0;
        }
        // A flat-bottomed dip with smooth flanks.
        self.notch_depth_mm * (-((y - nearest) / NOTCH_HALF_MM).powi(4)).exp()
    }

    fn surface(&self, station: &Station, point: &Point) -> DVec3 {
        let edge = self.edge_mm();
        // Centres of the edge arcs, which converge over the rounded ends.
        let half = self.width_mm / 2.0 - station.side - edge;
        let low = station.face + edge;
        let high = self.thickness_mm - station.face - edge;
        let x = half * point.across + edge * point.round.0;
        let mut height = low + (high - low) * point.up + edge * point.round.1;
        if point.up > 0.5 && point.round.1 > 0.999 {
            // Flat towards the edges, so that the rounding continues without a crease.
            height -= self.hollow_mm * (1.0 - point.across * point.across).powi(2);
        }
        DVec3::new(x, station.y, -height)
    }
}

#[cfg(test)]
mod tests {
    use super::super::check;
    use super::*;

    #[test]
    fn mesh_is_closed_and_of_the_requested_size() {
        for (width_mm, length_mm, thickness_mm, triangles) in [
            (530.0, 900.0, 50.0, 40_000),
            (400.0, 2000.0, 80.0, 20_000),
            (200.0, 300.0, 20.0, 150_000),
        ] {
            let params = Couch {
                width_mm,
                length_mm,
                thickness_mm,
                triangles,
                ..Couch::default()
            };
            params.check().unwrap();
            let mesh = couch(&params);
            let volume = check::closed(&mesh);
            let fill = volume / (width_mm * length_mm * thickness_mm);
            assert!((0.7..1.0).contains(&fill), "{fill}");
            let (lo, hi) = mesh.bounds().unwrap();
            let half = DVec3::new(width_mm, length_mm, 0.0) / 2.0;
            assert!(
                (lo + half + DVec3::Z * thickness_mm).length() < 0.01,
                "{lo}"
            );
            assert!((hi - half).length() < 0.01, "{hi}");
            let count = mesh.triangles.len() as f64;
            assert!((count / f64::from(triangles) - 1.0).abs() < 0.25, "{count}");
        }
    }

    #[test]
    fn the_top_is_hollow_and_the_sides_are_notched() {
        let mesh = couch(&Couch::default());
        let top = |x: f64| {
            mesh.vertices
                .iter()
                .filter(|v| (v.x - x).abs() < 8.0 && v.y.abs() < 300.0)
                .map(|v| v.z)
                .fold(0.0, f64::min)
        };
        assert!((top(0.0) + 47.0).abs() < 0.1, "{}", top(0.0));
        assert!((top(240.0) + 50.0).abs() < 0.2, "{}", top(240.0));
        let side = |y: f64| {
            mesh.vertices
                .iter()
                .filter(|v| (v.y - y).abs() < 5.0)
                .map(|v| v.x)
                .fold(0.0, f64::max)
        };
        assert!((side(140.0) - 253.0).abs() < 0.5, "{}", side(140.0));
        assert!((side(70.0) - 265.0).abs() < 0.5, "{}", side(70.0));
    }

    #[test]
    fn parameters_out_of_range_are_named_and_do_not_panic() {
        let mad = Couch {
            width_mm: 0.0,
            notch_spacing_mm: f64::NAN,
            triangles: 1,
            ..Couch::default()
        };
        assert_eq!(mad.check().unwrap_err().0, "width_mm");
        check::closed(&couch(&mad));
    }
}
