//! Divides the region into patches to measure how much of it a scan covers.

use super::Facet;
use std::collections::HashMap;

/// Edge of a patch in millimetres: coarser than the spacing of points (a few lie in each), finer than
/// objects that occlude a patient.
const PATCH_MM: f64 = 20.0;

/// Patches of the region of interest.
pub(super) struct Patches {
    /// Patch of each triangle; `u32::MAX` outside the region.
    of: Vec<u32>,
    area_mm2: Vec<f64>,
}

impl Patches {
    pub(super) fn new(facets: &[Facet], inside: &[bool]) -> Self {
        let mut numbers: HashMap<[i64; 3], u32> = HashMap::new();
        let mut area_mm2: Vec<f64> = Vec::new();
        let of = facets
            .iter()
            .zip(inside)
            .map(|(facet, &inside)| {
                if !inside {
                    return u32::MAX;
                }
                let [a, b, c] = facet.corners;
                let cell = ((a + b + c) / (3.0 * PATCH_MM)).floor();
                let key = cell.to_array().map(|x| x as i64);
                let next = numbers.len() as u32;
                let number = *numbers.entry(key).or_insert(next);
                area_mm2.resize(numbers.len(), 0.0);
                area_mm2[number as usize] += (b - a).cross(c - a).length() / 2.0;
                number
            })
            .collect();
        Self { of, area_mm2 }
    }

    pub(super) fn total_mm2(&self) -> f64 {
        self.area_mm2.iter().sum()
    }

    /// Area in square millimetres of the patches that contain these triangles.
    pub(super) fn covered_mm2(&self, triangles: impl Iterator<Item = u32>) -> f64 {
        let mut seen = vec![false; self.area_mm2.len()];
        for t in triangles {
            if let Some(seen) = seen.get_mut(self.of[t as usize] as usize) {
                *seen = true;
            }
        }
        let areas = self.area_mm2.iter().zip(seen);
        areas.filter(|(_, seen)| *seen).map(|(a, _)| a).sum()
    }
}
