//! Triangulation with a projector whose lens bends.

use super::case::{Case, worse};
use super::rays::{EPS, ROUNDINGS, WIDTH, rig};
use glam::{DVec2, DVec3};
use phasmid_core::error::Result;
use phasmid_decode::triangulate::{Measured, Triangulator};
use phasmid_geometry::Lens;

/// Depth by both coordinates, and by columns alone, where a projector's lens bends.
pub(super) fn distorted() -> Result<Vec<Case>> {
    let one = |k1: f64| {
        let mut rig = rig(400.0, DVec3::new(1.0, -18.0, 2.0));
        rig.projector.lens.distortion = [k1, 0.1 * k1.abs(), 1e-3 * k1, -2e-3 * k1, 0.0];
        rig.projector.lens.height_px = 768;
        rig.projector.lens.principal_px.y = 383.5;
        let triangulator = Triangulator::new(&rig, WIDTH, 48)?;
        let (mut worst, mut shift, mut lit, mut none) = ((0.0, f64::INFINITY), 0.0_f64, 0, 0);
        for distance in [300.0, 1e3, 3e3, 1e4, 1e5] {
            for i in 0..WIDTH * 48 {
                let at = DVec2::new((i % WIDTH) as f64, (i / WIDTH) as f64);
                let ray = rig.camera.lens.ray(at);
                let depth = distance / (1.0 + 0.2 * ray.x - 0.1 * ray.y);
                let seen = |depth: f64| rig.projector.project(ray * depth);
                let ends = [1.0 - 1e-5, 1.0 + 1e-5].map(|by| seen(depth * by));
                let (Some(px), [Some(low), Some(high)]) = (seen(depth), ends) else {
                    continue;
                };
                let lens = &rig.projector.lens;
                if !lens.contains(px) {
                    continue;
                }
                lit += 1;
                let ideal = Lens {
                    distortion: [0.0; 5],
                    ..*lens
                };
                let way = rig.projector.rig_from_view.inverse().point(ray * depth);
                shift = ideal
                    .project(way)
                    .map_or(shift, |ideal| shift.max((ideal - px).length()));
                let both = [px.x, px.y].map(|px| Some(Measured { px, sigma: 1e-6 }));
                let slope = 2e-5 * depth / (high - low).x.abs();
                // With a known point the first decides; rows may say less.
                let allowed = ROUNDINGS * EPS * (1.0 + slope * 4000.0 / depth);
                for y in [both[1], None] {
                    let Some((found, _)) = triangulator.depth(at, both[0], y) else {
                        none += 1;
                        continue;
                    };
                    let error = (found - depth).abs() / depth;
                    worse(&mut worst, error, allowed);
                }
            }
        }
        let name = format!("k1 = {k1}");
        let case = Case::held(name, shift, worst.0, worst.1);
        Ok(case.kept(1.0 - f64::from(none) / f64::from((2 * lit).max(1)), 0.999))
    };
    [-1e-6, -0.1, -0.5, -1.0, 0.5, 2.0, 10.0]
        .into_iter()
        .map(one)
        .collect()
}
