//! Error of the indirect light for a number of rays and a spacing of gather points, and the light
//! of further bounces.
//!
//! At a sample of pixels, the indirect light that the renderer would interpolate is compared with a
//! reference from many rays.

use super::gather::Gatherer;
use super::grid::Grid;
use crate::Plan;
use crate::exposure::{Gathering, GeometryBuffer};
use crate::scene::Worlds;
use crate::transport::rays::Rays;
use phasmid_geometry::raycast::Scratch;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Candidate settings (number of rays, spacing of gather points in pixels), the cheapest first.
const SETTINGS: [[u32; 2]; 9] = [
    [64, 8],
    [64, 4],
    [256, 4],
    [64, 2],
    [256, 2],
    [512, 2],
    [1024, 2],
    [512, 1],
    [1024, 1],
];
/// Number of pixels examined.
const PIXELS: usize = 256;
/// Fraction of the pixels whose error must be within the bound.
const MOST: f64 = 0.99;
/// The reference is the mean of `TURNS` gatherings with `RAYS` rays each; each gathering is rotated
/// differently.
const RAYS: usize = 1024;
const TURNS: u32 = 4;
/// For the second bounce, every `FEW`th pixel of the sample is used. The first number of
/// `SECOND_RAYS` is the number of rays from the pixel, the second the number of rays from the end of
/// each of these rays.
const FEW: usize = 4;
const SECOND_RAYS: [usize; 2] = [64, 256];

/// A sample of pixels that the projector lights, with reference values of their indirect light.
pub(crate) struct Trial<'a> {
    worlds: &'a Worlds,
    rays: &'a Rays<'a>,
    plan: &'a Plan,
    map: &'a GeometryBuffer,
    pixels: Vec<usize>,
    /// Reference of the indirect irradiance from full white in W/m^2.
    reference: Vec<f64>,
}

impl<'a> Trial<'a> {
    /// Selects pixels of a scene by its geometry maps, which need not contain indirect light, and
    /// computes the reference at these pixels.
    pub(crate) fn new(
        worlds: &'a Worlds,
        rays: &'a Rays<'a>,
        plan: &'a Plan,
        map: &'a GeometryBuffer,
    ) -> Self {
        let lit: Vec<usize> = (0..map.flags.len())
            .filter(|&i| map.projected[i] > 0.0 && map.evenly[i] > 0.0)
            .collect();
        let mut pixels: Vec<usize> = (0..PIXELS)
            .filter_map(|k| {
                // Divide the lit pixels into `PIXELS` stretches and select one pixel of each, at a
                // different position in each stretch.
                let place = k as f64 + (k as f64 * 0.618_033_988_75).fract();
                lit.get((place / PIXELS as f64 * lit.len() as f64) as usize)
            })
            .copied()
            .collect();
        pixels.dedup();
        let mut trial = Self {
            worlds,
            rays,
            plan,
            map,
            pixels,
            reference: Vec::new(),
        };
        let gatherer = trial.gatherer(RAYS);
        trial.reference = trial.each(|pixel, scratch| {
            let world = worlds.at(pixel / map.width);
            let turns = (0..TURNS).map(|turn| {
                let mut place = gatherer.place(&world, map, pixel);
                // The half step keeps all rotations different from the rotation of the gatherings under
                // test.
                place.turn += TAU * (f64::from(turn) + 0.5) / f64::from(TURNS);
                gatherer.white(&place, scratch)
            });
            turns.sum::<f64>() / f64::from(TURNS)
        });
        trial
    }

    fn gatherer(&self, rays: usize) -> Gatherer<'a> {
        Gatherer::new(self.worlds, self.rays, self.plan, rays)
    }

    fn each(&self, of: impl Fn(usize, &mut Scratch) -> f64 + Sync) -> Vec<f64> {
        let pixels = self.pixels.par_iter();
        let of = |scratch: &mut Scratch, &pixel: &usize| match self.worlds.stop.is_asked() {
            true => 0.0,
            false => of(pixel, scratch),
        };
        pixels.map_init(Scratch::default, of).collect()
    }

    /// Returns the total light of a pixel, including the reference, in electrons per second under
    /// full white.
    fn light(&self, k: usize) -> f64 {
        let pixel = self.pixels[k];
        f64::from(self.map.projected[pixel]) + f64::from(self.map.evenly[pixel]) * self.reference[k]
    }

    /// Returns the 99th percentile of the error of the indirect light over the pixels, as a fraction
    /// of each pixel's light.
    pub(crate) fn error(&self, gathering: Gathering) -> f64 {
        let (map, step) = (self.map, gathering.step_px as usize);
        let grid = Grid::new(map, self.rays, step);
        let gatherer = self.gatherer(gathering.samples as usize);
        let found = self.each(|pixel, scratch| {
            let first = grid.first[pixel] as usize;
            let corners = [
                first,
                first + 1,
                first + grid.stride,
                first + grid.stride + 1,
            ];
            let shares = grid.shares[pixel].map(f64::from).into_iter();
            let light = corners.into_iter().zip(shares).map(|(corner, share)| {
                let corner = grid.pixels.get(corner).copied().flatten();
                let Some(corner) = corner.filter(|_| share > 0.0) else {
                    return 0.0;
                };
                let world = self.worlds.at(corner / map.width);
                share * gatherer.white(&gatherer.place(&world, map, corner), scratch)
            });
            light.sum()
        });
        let errors = found.iter().enumerate().map(|(k, found)| {
            let exact = f64::from(map.evenly[self.pixels[k]]) * self.reference[k];
            (found - exact).abs() / self.light(k)
        });
        quantile(errors.collect(), MOST)
    }

    /// Returns the cheapest settings whose error is within a bound, or the most accurate settings if
    /// there are none.
    pub(crate) fn choose(&self, bound: f64) -> Gathering {
        let settings = SETTINGS.map(|[samples, step_px]| Gathering { samples, step_px });
        let enough = |gathering: &Gathering| self.error(*gathering) <= bound;
        let best = settings[settings.len() - 1];
        settings.into_iter().find(enough).unwrap_or(best)
    }

    /// Returns the light that all bounces after the first would add, as a fraction of a pixel's
    /// light: the median and the 95th percentile over the pixels.
    pub(crate) fn further(&self) -> [f64; 2] {
        let ([outer, inner], map) = (SECOND_RAYS.map(|rays| self.gatherer(rays)), self.map);
        let some: Vec<usize> = (0..self.pixels.len()).step_by(FEW).collect();
        let of = |scratch: &mut Scratch, &k: &usize| {
            let pixel = self.pixels[k];
            let world = self.worlds.at(pixel / map.width);
            let place = outer.place(&world, map, pixel);
            let (first, second) = (self.reference[k], outer.second(&place, &inner, scratch));
            // Each bounce adds about the same fraction of the previous bounce's light.
            let ratio = if first > 0.0 {
                (second / first).min(0.95)
            } else {
                0.0
            };
            f64::from(map.evenly[pixel]) * second / (1.0 - ratio) / self.light(k)
        };
        let further: Vec<f64> = some.par_iter().map_init(Scratch::default, of).collect();
        [0.5, 0.95].map(|part| quantile(further.clone(), part))
    }
}

/// Returns the given quantile of the values; 0 if there are no values.
fn quantile(mut values: Vec<f64>, part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (part * values.len() as f64).ceil() as usize;
    at.checked_sub(1).map_or(0.0, |at| values[at])
}
