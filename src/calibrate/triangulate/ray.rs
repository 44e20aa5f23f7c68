//! One ray with one coordinate or both, distortion and all: the plane's depth, then Gauss-Newton.

use super::{Measured, Triangulator, WORST_RELATIVE_SIGMA};
use glam::DVec2;

/// With both axes decoded, a point whose projection misses them by more than this many projector
/// pixels (and 6 deviations) has a wrong order on one of them.
const WORST_MISS_PX: f64 = 5.0;
const ITERATIONS: usize = 8;

impl Triangulator {
    /// Depth (z in the camera's frame) and its standard deviation, both in mm, of the ray through
    /// camera pixel `camera_px` lit from the given projector coordinates: the f64 path, from the
    /// lens itself. `None` without a coordinate, behind either lens, or without parallax.
    pub fn depth(
        &self,
        camera_px: DVec2,
        x: Option<Measured>,
        y: Option<Measured>,
    ) -> Option<(f64, f64)> {
        self.solve(self.rig.camera.lens.ray(camera_px).truncate(), x, y)
    }

    /// The depth and its standard deviation along a ray X/Z, Y/Z of the camera.
    pub(super) fn solve(
        &self,
        ray: DVec2,
        x: Option<Measured>,
        y: Option<Measured>,
    ) -> Option<(f64, f64)> {
        let lens = &self.rig.projector.lens;
        let b = self.turn * ray.extend(1.0);
        let a = self.origin;
        let both = x.is_some() && y.is_some();
        // The plane of the axis that knows 1/t better, without distortion.
        let mut start: Option<(f64, f64)> = None;
        for (k, m) in [x, y].into_iter().enumerate() {
            let Some(m) = m else { continue };
            let xn = (m.px - lens.principal_px[k]) / lens.focal_px[k];
            let parallax = b[k] - xn * b.z;
            let t = (xn * a.z - a[k]) / parallax;
            let slope = (a.z * b[k] - a[k] * b.z) / (parallax * parallax * lens.focal_px[k]);
            let s = slope.abs() * m.sigma;
            if t > 0.0 && start.is_none_or(|(u, best)| s / (t * t) < best / (u * u)) {
                start = Some((t, s));
            }
        }
        let (mut t, mut s) = start?;
        if both || lens.is_distorted() {
            let pixel = DVec2::from([x, y].map(|m| m.map_or(0.0, |m| m.px)));
            let weight = [x, y].map(|m| m.map_or(0.0, |m| 1.0 / m.sigma.powi(2).max(1e-12)));
            let weight = DVec2::from(weight);
            // Projections are nearly linear in the inverse depth, and far from it in the depth.
            let mut w = 1.0 / t;
            let mut converged = false;
            for _ in 0..ITERATIONS {
                let p = a * w + b;
                if p.z <= 0.0 {
                    return None;
                }
                let ideal = p.truncate() / p.z;
                let rate = (a.truncate() - ideal * a.z) / p.z;
                let px_rate = lens.focal_px * (lens.distort_jacobian(ideal) * rate);
                let miss = lens.distort_to_px(ideal) - pixel;
                let information = (weight * px_rate * px_rate).element_sum();
                let step = (weight * px_rate * miss).element_sum() / information;
                w -= step;
                if step.abs() <= 1e-10 * w.abs() {
                    let fits = |k: usize, m: Option<Measured>| {
                        m.is_none_or(|m| miss[k].abs() <= (6.0 * m.sigma).max(WORST_MISS_PX))
                    };
                    converged = fits(0, x) && fits(1, y);
                    (t, s) = (1.0 / w, 1.0 / (w * w * information.sqrt()));
                    break;
                }
            }
            if !converged {
                return None;
            }
        }
        let good = t > 0.0 && (a.z + t * b.z) > 0.0 && s <= WORST_RELATIVE_SIGMA * t;
        good.then_some((t, s))
    }
}
