//! Depth of field: the camera's pupil as a disc instead of a point.
//!
//! A thin lens (e.g. Ray: "Applied Photographic Optics", chapter 22): all rays from the lens to a
//! pixel come from one point of the plane in focus. A point at depth z is imaged to a disc of radius
//! r |1/z - 1/z_focus| in units of the focal length, where r is the radius of the pupil.

use crate::exposure::GeometryBuffer;
use glam::{DVec2, DVec3};
use phasmid_profile::Camera;
use rayon::prelude::*;

/// Maximum radius in pixels of blur discs that are ignored.
const SHARP_PX: f64 = 1e-3;
/// Maximum radius of a blur disc in pixels. Without this limit the radius would be infinite for a
/// point in the pupil.
const LARGEST_PX: f64 = 1e6;
/// Golden angle between consecutive points of a Vogel spiral on the disc (Vogel: "A better way to
/// construct the sunflower head", Mathematical Biosciences 44, 1979): pi (3 - sqrt 5).
const GOLDEN: f64 = 2.399_963_229_728_653;

/// The pupil in the plane z = 0 of the camera's frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Aperture {
    /// Radius in millimetres; 0 if there is no focus distance, so that everything is sharp.
    pub(crate) radius_mm: f64,
    /// Inverse distance of the plane in focus, in 1/mm.
    pub(crate) focus: f64,
    /// Focal length in units of the pixel width.
    pub(crate) focal_px: f64,
    /// Width of a pixel over its height.
    pub(crate) pixel_aspect: f64,
}

impl Aperture {
    /// Creates the pupil. Its diameter is the image distance divided by the working f-number; the
    /// image distance is approximated by the profile's focal length.
    pub(crate) fn new(camera: &Camera) -> Self {
        let radius_mm = camera.focal_length_mm / camera.f_number / 2.0;
        Self {
            radius_mm: camera.focus_mm.map_or(0.0, |_| radius_mm),
            focus: camera.focus_mm.map_or(0.0, |focus| 1.0 / focus),
            focal_px: camera.focal_length_mm / camera.pixel_pitch_mm(),
            pixel_aspect: camera.pixel_aspect,
        }
    }

    /// Returns the radius, in pixel widths, of the blur disc of a point at a depth in millimetres;
    /// NaN or 0 if no surface is visible.
    pub(crate) fn blur_px(&self, depth_mm: f64) -> f64 {
        let radius = self.focal_px * self.radius_mm * (1.0 / depth_mm - self.focus).abs();
        // A NaN radius stays NaN, unlike with `min`.
        if radius > LARGEST_PX {
            LARGEST_PX
        } else {
            radius
        }
    }

    /// Returns one of `count` points that are evenly distributed over the pupil; all points are
    /// rotated by `turn`.
    pub(crate) fn point(&self, index: usize, count: usize, turn: f64) -> DVec3 {
        let radius = self.radius_mm * ((index as f64 + 0.5) / count as f64).sqrt();
        (DVec2::from_angle(index as f64 * GOLDEN + turn) * radius).extend(0.0)
    }

    /// Converts the direction (z = 1) of the ray through the pupil's centre to the direction of the
    /// ray that goes to the same pixel through another point of the pupil.
    pub(crate) fn through(&self, point: DVec3, direction: DVec3) -> DVec3 {
        direction - point * self.focus
    }

    /// Widens the footprints of all pixels by the defocus blur at their centres' depth.
    pub(crate) fn widen(&self, map: &mut GeometryBuffer) {
        for slopes in [&mut map.x_slope, &mut map.y_slope] {
            slopes
                .par_iter_mut()
                .zip(&map.depth)
                .for_each(|(slope, &depth)| {
                    let blur = self.blur_px(f64::from(depth));
                    *slope = widened(*slope, blur, self.pixel_aspect);
                });
        }
    }
}

/// Returns the widths of two boxes whose convolution approximates the convolution of a footprint
/// (itself two boxes) with a disc of a radius in pixel widths. Both have the same variance and, as
/// far as two boxes allow, the same fourth cumulant, so that contrast is correct to fourth order in
/// frequency. `aspect` is the width of a pixel over its height, so the disc is an ellipse in pixels.
///
/// Along the pattern image's axis the disc is a semicircle (Wigner's distribution) of radius
/// rho = radius |(a, aspect b)|: variance rho^2 / 4, fourth cumulant -rho^4 / 16; a box of width w has
/// w^2 / 12 and -w^4 / 120. Hence two boxes with w1^2 + w2^2 = a^2 + b^2 + 3 rho^2 and
/// w1^4 + w2^4 = a^4 + b^4 + 7.5 rho^4.
pub(crate) fn widened(slope: [f32; 2], radius_px: f64, aspect: f64) -> [f32; 2] {
    // The radius is NaN if no surface is visible.
    if !(radius_px > SHARP_PX) {
        return slope;
    }
    let [a, b] = slope.map(|s| f64::from(s).powi(2));
    let rho = radius_px * radius_px * (a + aspect * aspect * b);
    let squares = a + b + 3.0 * rho;
    let fourths = a * a + b * b + 7.5 * rho * rho;
    let apart = (2.0 * fourths - squares * squares).max(0.0).sqrt();
    let wide = ((squares + apart) / 2.0).sqrt() as f32;
    let narrow = ((squares - apart) / 2.0).max(0.0).sqrt() as f32;
    if a >= b {
        [wide, narrow]
    } else {
        [narrow, wide]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Returns the fraction of a unit disc to the left of t.
    fn disc(t: f64) -> f64 {
        let t = t.clamp(-1.0, 1.0);
        0.5 + (t * (1.0 - t * t).sqrt() + t.asin()) / PI
    }

    /// Returns the fraction of the convolution of two boxes to the left of x.
    fn boxes(x: f64, [a, b]: [f64; 2]) -> f64 {
        let n = 400;
        let at = |i: i32| x + a * ((f64::from(i) + 0.5) / f64::from(n) - 0.5);
        (0..n)
            .map(|i| (at(i) / b + 0.5).clamp(0.0, 1.0))
            .sum::<f64>()
            / f64::from(n)
    }

    #[test]
    fn the_spread_of_an_edge_is_that_of_the_disc() {
        for (slope, radius, aspect, bar) in [
            ([2.0f32, 0.3], 4.0, 1.0, 0.008),
            ([2.0, 1.9], 4.0, 1.0, 0.008),
            ([2.0, 1.9], 4.0, 0.7, 0.008),
            ([0.3, 2.0], 4.0, 1.5, 0.008),
            ([0.1, -1.5], 1.0, 1.0, 0.012),
            ([1.0, 1.0], 0.5, 1.0, 0.02),
            ([3.0, 0.0], 0.2, 1.0, 0.02),
        ] {
            let wide = widened(slope, radius, aspect).map(f64::from);
            let pixel = slope.map(|s| f64::from(s).abs().max(1e-9));
            let rho = radius * f64::from(slope[0]).hypot(aspect * f64::from(slope[1]));
            let mut worst = 0.0f64;
            for k in -300..=300 {
                let x = f64::from(k) / 200.0 * (rho + pixel[0] + pixel[1]);
                // Reference: the disc convolved with both boxes of the pixel.
                let n = 60;
                let mut exact = 0.0;
                for i in 0..n * n {
                    let share = |i: i32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
                    let shift = share(i % n) * pixel[0] + share(i / n) * pixel[1];
                    exact += disc((x + shift) / rho) / f64::from(n * n);
                }
                worst = worst.max((boxes(x, wide) - exact).abs());
            }
            assert!(worst < bar, "{slope:?} {radius} {aspect}: {worst}");
        }
    }

    #[test]
    fn footprint_without_blur_is_unchanged() {
        assert_eq!(widened([1.5, -0.25], 0.0, 1.0), [1.5, -0.25]);
        assert_eq!(widened([1.5, -0.25], f64::NAN, 1.0), [1.5, -0.25]);
    }
}
