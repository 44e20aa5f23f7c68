//! Depth from a camera pixel and the projector column and/or row that lit it.
//!
//! A camera ray o + t d (d with z = 1 in the camera's frame, so that t is the depth) is carried into
//! the projector's frame as a + t b. A column with ideal image coordinate xn is the plane
//! X = xn Z there, so t = (xn a_z - a_x) / (b_x - xn b_z); a row likewise. With projector
//! distortion, or with both axes, t minimises the squared differences between the projected point
//! and the decoded coordinates, weighted by their variances, by Gauss-Newton on 1/t from the plane's t.

use crate::error::{Error, Result};
use crate::geometry::{Pose, Rig};
use crate::pattern::Axis;
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

/// A depth known worse than this part of itself is no depth: the parallax is lost in noise.
const WORST_RELATIVE_SIGMA: f64 = 0.05;
/// With both axes decoded, a point whose projection misses them by more than this many projector
/// pixels (and 6 deviations) has a wrong order on one of them.
const WORST_MISS_PX: f64 = 5.0;
const ITERATIONS: usize = 8;

/// A decoded projector coordinate in pixels and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Coordinate in projector pixels.
    pub px: f64,
    /// Standard deviation in projector pixels.
    pub sigma: f64,
}

/// One row of decoded coordinates and standard deviations; NaN where there is none.
#[derive(Debug, Clone, Copy)]
pub struct CoordinateRow<'a> {
    /// Coordinates in projector pixels.
    pub px: &'a [f32],
    /// Standard deviations in projector pixels.
    pub sigma: &'a [f32],
}

/// A rig with its camera's rays tabulated; made once, used for every scan.
#[derive(Debug, Clone)]
pub struct Triangulator {
    rig: Rig,
    width: usize,
    /// X/Z and Y/Z of each camera pixel's ray.
    rays: [Vec<f32>; 2],
    /// Whether the camera's frame is the rig's, so that points need no motion.
    camera_is_rig: bool,
    /// The camera's pupil in the projector's frame.
    origin: DVec3,
    /// Takes directions in the camera's frame to the projector's.
    turn: DMat3,
}

impl Triangulator {
    /// Tabulates the rays of a rig's camera for images of `width` x `height`.
    ///
    /// # Errors
    /// An image size other than the rig's camera has.
    pub fn new(rig: &Rig, width: usize, height: usize) -> Result<Self> {
        let lens = &rig.camera.lens;
        if (lens.width_px as usize, lens.height_px as usize) != (width, height) {
            return Err(Error::input(
                "calibration: camera.lens.width_px/height_px",
                format!("{} x {}", lens.width_px, lens.height_px),
                format!("the frames' size, {width} x {height}"),
            ));
        }
        let mut rays = [vec![0.0f32; width * height], vec![0.0f32; width * height]];
        let [xs, ys] = &mut rays;
        xs.par_chunks_mut(width)
            .zip(ys.par_chunks_mut(width))
            .enumerate()
            .for_each(|(v, (xs, ys))| {
                for (u, (x, y)) in xs.iter_mut().zip(ys).enumerate() {
                    let ray = lens.ray(DVec2::new(u as f64, v as f64));
                    (*x, *y) = (ray.x as f32, ray.y as f32);
                }
            });
        let projector_from_rig = rig.projector.rig_from_view.inverse();
        let projector_from_camera = projector_from_rig * rig.camera.rig_from_view;
        Ok(Self {
            rig: *rig,
            width,
            rays,
            camera_is_rig: rig.camera.rig_from_view == Pose::IDENTITY,
            origin: projector_from_camera.translation_mm,
            turn: projector_from_camera.rotation,
        })
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

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

    /// Depths and standard deviations, in mm, of row `v` of the image: NaN where there is none.
    #[inline(always)]
    pub fn row(
        &self,
        v: usize,
        x: Option<CoordinateRow<'_>>,
        y: Option<CoordinateRow<'_>>,
        depth: &mut [f32],
        sigma: &mut [f32],
    ) {
        if !self.rig.projector.lens.is_distorted() {
            match (x, y) {
                (Some(x), None) => return self.plane_row(v, Axis::X, x, depth, sigma),
                (None, Some(y)) => return self.plane_row(v, Axis::Y, y, depth, sigma),
                _ => {}
            }
        }
        let at = v * self.width;
        let measured = |row: Option<CoordinateRow<'_>>, u: usize| {
            row.map(|r| Measured {
                px: f64::from(r.px[u]),
                sigma: f64::from(r.sigma[u]),
            })
            .filter(|m| !m.px.is_nan())
        };
        for u in 0..depth.len() {
            let ray = self.rays.each_ref().map(|r| f64::from(r[at + u]));
            let found = self.solve(ray.into(), measured(x, u), measured(y, u));
            let (t, s) = found.unwrap_or((f64::NAN, f64::NAN));
            (depth[u], sigma[u]) = (t as f32, s as f32);
        }
    }

    /// One plane a pixel. The parallax is a difference of nearly equal directions: in f32 it costs
    /// up to 1.6e-3 mm at 1.6 m (measured with the test's rig), in f64 from f32 rays and coordinates
    /// a sixth of it.
    #[inline(always)]
    fn plane_row(
        &self,
        v: usize,
        axis: Axis,
        row: CoordinateRow<'_>,
        depth: &mut [f32],
        sigma: &mut [f32],
    ) {
        let n = depth.len();
        let at = v * self.width;
        let (rx, ry) = (&self.rays[0][at..at + n], &self.rays[1][at..at + n]);
        let (px, sd) = (&row.px[..n], &row.sigma[..n]);
        let sigma = &mut sigma[..n];
        let k = axis as usize;
        let lens = &self.rig.projector.lens;
        let (inverse_focal, center) = (1.0 / lens.focal_px[k], lens.principal_px[k]);
        let (a, az) = (self.origin[k], self.origin.z);
        let ([m0, m1, m2], [z0, z1, z2]) =
            (self.turn.row(k).to_array(), self.turn.row(2).to_array());
        for u in 0..n {
            let (rx, ry) = (f64::from(rx[u]), f64::from(ry[u]));
            let b = m0 * rx + m1 * ry + m2;
            let bz = z0 * rx + z1 * ry + z2;
            let xn = (f64::from(px[u]) - center) * inverse_focal;
            let parallax = 1.0 / (b - xn * bz);
            let t = (xn * az - a) * parallax;
            let slope = (az * b - a * bz) * inverse_focal * (parallax * parallax);
            let s = slope.abs() * f64::from(sd[u]);
            // NaN fails each of these.
            let good = (t > 0.0) & (az + t * bz > 0.0) & (s <= WORST_RELATIVE_SIGMA * t);
            depth[u] = if good { t as f32 } else { f32::NAN };
            sigma[u] = if good { s as f32 } else { f32::NAN };
        }
    }

    fn solve(&self, ray: DVec2, x: Option<Measured>, y: Option<Measured>) -> Option<(f64, f64)> {
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

    /// The point in the rig's frame, in mm, at a depth along the ray of pixel (u, v).
    #[inline(always)]
    pub fn point(&self, u: usize, v: usize, depth: f32) -> [f32; 3] {
        let i = v * self.width + u;
        if self.camera_is_rig {
            return [self.rays[0][i] * depth, self.rays[1][i] * depth, depth];
        }
        let local = DVec3::new(f64::from(self.rays[0][i]), f64::from(self.rays[1][i]), 1.0);
        let view = &self.rig.camera.rig_from_view;
        view.point(local * f64::from(depth)).as_vec3().to_array()
    }

    /// The points of row `v` whose depth is not NaN, into `points`, which is as long as they are
    /// many.
    pub fn points_row(&self, v: usize, depth: &[f32], points: &mut [[f32; 3]]) {
        let at = v * self.width;
        let (rx, ry) = (&self.rays[0][at..], &self.rays[1][at..]);
        let mut next = points.iter_mut();
        for (u, ((&z, &x), &y)) in depth.iter().zip(rx).zip(ry).enumerate() {
            if z.is_nan() {
                continue;
            }
            let Some(point) = next.next() else { return };
            *point = if self.camera_is_rig {
                [x * z, y * z, z]
            } else {
                self.point(u, v, z)
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Lens, View};

    fn rig(camera: [f64; 5], projector: [f64; 5]) -> Rig {
        let view = |width_px, height_px, f, principal_px, distortion, pose| View {
            lens: Lens {
                width_px,
                height_px,
                focal_px: DVec2::splat(f),
                principal_px,
                distortion,
            },
            rig_from_view: pose,
        };
        Rig {
            camera: view(
                160,
                90,
                90.0,
                DVec2::new(79.3, 44.9),
                camera,
                Pose::IDENTITY,
            ),
            projector: view(
                1920,
                1080,
                2751.0,
                DVec2::new(2060.0, 540.0),
                projector,
                Pose::from_xyz_deg(DVec3::new(400.0, 20.0, -15.0), DVec3::new(1.0, -3.0, 2.0)),
            ),
            noise: None,
        }
    }

    /// Worst error over a tilted plane, where the projector lights it: row kernel and f64 path.
    fn worst(rig: &Rig, use_x: bool, use_y: bool) -> (f64, f64) {
        let triangulator = Triangulator::new(rig, 160, 90).unwrap();
        let (mut row_worst, mut f64_worst, mut lit) = (0.0f64, 0.0f64, 0);
        for v in 0..90 {
            let (mut xs, mut ys) = (vec![f32::NAN; 160], vec![f32::NAN; 160]);
            let mut truth = vec![f64::NAN; 160];
            for u in 0..160 {
                let camera_px = DVec2::new(u as f64, v as f64);
                let d = rig.camera.ray(camera_px);
                let t = 1000.0 / (1.0 + 0.3 * d.x - 0.2 * d.y);
                let px = rig.projector.project(d * t).unwrap();
                if !rig.projector.lens.contains(px) {
                    continue;
                }
                (truth[u], xs[u], ys[u]) = (t, px.x as f32, px.y as f32);
                lit += 1;
                let measured = |on: bool, px| on.then_some(Measured { px, sigma: 0.02 });
                let (x, y) = (measured(use_x, px.x), measured(use_y, px.y));
                let (depth, _) = triangulator.depth(camera_px, x, y).unwrap();
                f64_worst = f64_worst.max((depth - t).abs());
            }
            let sigma = vec![0.02; 160];
            let (mut depth, mut sd) = (vec![0.0; 160], vec![0.0; 160]);
            let row = |on: bool, px| on.then_some(CoordinateRow { px, sigma: &sigma });
            triangulator.row(v, row(use_x, &xs), row(use_y, &ys), &mut depth, &mut sd);
            for (d, t) in depth.iter().zip(&truth) {
                assert_eq!(d.is_nan(), t.is_nan());
                row_worst = row_worst.max((f64::from(*d) - t).abs());
            }
        }
        assert!(lit > 1500, "{lit}");
        (row_worst, f64_worst)
    }

    #[test]
    fn depth_comes_back_with_and_without_distortion() {
        let k = [-0.12, 0.03, 8e-4, -5e-4, 0.0];
        let none = [0.0; 5];
        for (camera, projector) in [(none, none), (k, none), (none, k), (k, k)] {
            for (use_x, use_y) in [(true, false), (true, true)] {
                let (row, exact) = worst(&rig(camera, projector), use_x, use_y);
                // What f32 coordinates and rays leave.
                assert!(row < 5e-4, "row {row:e} mm");
                assert!(exact < 1e-7, "f64 {exact:e} mm");
            }
        }
    }

    #[test]
    fn sigma_is_the_slope_of_depth() {
        let rig = rig([0.0; 5], [-0.12, 0.03, 8e-4, -5e-4, 0.0]);
        let triangulator = Triangulator::new(&rig, 160, 90).unwrap();
        let at = |px| {
            let x = Some(Measured { px, sigma: 0.02 });
            triangulator.depth(DVec2::new(80.0, 40.0), x, None).unwrap()
        };
        let (h, middle) = (0.01, at(960.0));
        let slope = (at(960.0 + h).0 - at(960.0 - h).0) / (2.0 * h);
        assert!((slope.abs() * 0.02 / middle.1 - 1.0).abs() < 1e-4);
    }

    #[test]
    fn what_has_no_parallax_has_no_depth() {
        let rig = rig([0.0; 5], [0.0; 5]);
        let triangulator = Triangulator::new(&rig, 160, 90).unwrap();
        let px = DVec2::new(80.0, 40.0);
        let x = |px| Some(Measured { px, sigma: 0.02 });
        assert!(triangulator.depth(px, None, None).is_none());
        // The ray's own vanishing point, and beyond it.
        let far = rig.projector.project(rig.camera.ray(px) * 1e7).unwrap();
        assert!(triangulator.depth(px, x(far.x), None).is_none());
        assert!(triangulator.depth(px, x(far.x + 500.0), None).is_none());
        // A row that no point of this ray is lit from.
        let near = rig.projector.project(rig.camera.ray(px) * 1e3).unwrap();
        assert!(triangulator.depth(px, x(near.x), x(near.y)).is_some());
        assert!(
            triangulator
                .depth(px, x(near.x), x(near.y + 40.0))
                .is_none()
        );
        assert!(Triangulator::new(&rig, 90, 160).is_err());
    }
}
