//! Triangulates one ray with one or both coordinates, including distortion: starts at the plane's
//! depth and refines by Gauss-Newton.

use super::{FARTHEST_MM, Measured, Triangulator, WORST_RELATIVE_SIGMA};
use glam::{DVec2, DVec3};
use phasmid_geometry::Vector2;

/// Maximum distance of the projected point from the decoded coordinates, in projector pixels; 6
/// standard deviations if that is larger. With both axes decoded, a larger distance means a wrong
/// fringe order on one of them.
const WORST_MISS_PX: f64 = 5.0;
const ITERATIONS: usize = 8;

impl Triangulator {
    /// Computes the depth (z in the camera's frame) and its standard deviation, both in mm, of the point
    /// at camera pixel `camera_px` that is lit from the given projector coordinates, in f64 directly
    /// from the lens model. Returns `None` if no coordinate is given, if the point is behind a lens, or
    /// if there is too little parallax.
    pub fn depth<V: Vector2>(
        &self,
        camera_px: V,
        x: Option<Measured>,
        y: Option<Measured>,
    ) -> Option<(f64, f64)> {
        self.solve(
            self.rig.camera.lens.ray(camera_px.to_glam()).truncate(),
            x,
            y,
        )
    }

    /// Computes the depth and its standard deviation along the camera ray with the direction (X/Z, Y/Z,
    /// 1).
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
        // Start at the undistorted plane of the axis that determines 1/t more precisely.
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
        let (t, s) = if both || lens.is_distorted() {
            let near = start.map(|(t, _)| self.refine([a, b], 1.0 / t, [x, y]));
            near.flatten()
                .or_else(|| self.refine_from_afar([a, b], [x, y]))?
        } else {
            start?
        };
        let ahead = t > 0.0 && t < FARTHEST_MM && (a.z + t * b.z) > 0.0;
        (ahead && s <= WORST_RELATIVE_SIGMA * t).then_some((t, s))
    }

    /// Refines from infinity, for far points: distortion can move a column by more than the parallax of
    /// such points, and the undistorted plane is then a bad start. The result must lie where the
    /// distortion model is valid (has not folded over).
    #[cold]
    fn refine_from_afar(&self, ray: [DVec3; 2], of: [Option<Measured>; 2]) -> Option<(f64, f64)> {
        let lens = &self.rig.projector.lens;
        if !lens.is_distorted() {
            return None;
        }
        let (t, s) = self.refine(ray, 0.0, of)?;
        let [a, b] = ray;
        lens.project(a + b * t)?;
        Some((t, s))
    }

    /// Gauss-Newton on w = 1/t for the ray a + t b; `None` if it does not converge or if the result
    /// does not match the coordinates.
    fn refine(
        &self,
        [a, b]: [DVec3; 2],
        mut w: f64,
        of: [Option<Measured>; 2],
    ) -> Option<(f64, f64)> {
        let lens = &self.rig.projector.lens;
        let pixel = DVec2::from(of.map(|m| m.map_or(0.0, |m| m.px)));
        let weight = of.map(|m| m.map_or(0.0, |m| 1.0 / m.sigma.powi(2).max(1e-12)));
        let weight = DVec2::from(weight);
        // Projections are nearly linear in the inverse depth, but not in the depth.
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
                let met = fits(0, of[0]) && fits(1, of[1]);
                return met.then(|| (1.0 / w, 1.0 / (w * w * information.sqrt())));
            }
        }
        None
    }
}
