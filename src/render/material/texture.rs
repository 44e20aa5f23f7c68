//! A texture as albedo: square texels, repeated infinitely and averaged over a pixel's footprint.
//!
//! Summed-area tables (Crow, "Summed-Area Tables for Texture Mapping", SIGGRAPH 1984) give the exact
//! mean over a rectangle aligned with the texels. A slanted footprint is divided into 4 x 4 to 8 x 8
//! pieces, and each piece is replaced by the rectangle with the same second moments. On a
//! checkerboard the error is at most 6 % of the contrast, and at most 2 % for 19 of 20 footprints.

use crate::image_file;
use glam::DVec2;
use image::{ImageReader, Limits};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::colour;
use std::io::Cursor;
use std::path::Path;

/// Maximum side length in texels. Reading an image of this size takes some 250 MB of memory.
const MAX_SIDE: u32 = 4096;
/// Minimum and maximum number of pieces along a side of a slanted footprint, and, between these
/// limits, number of pieces per texel.
const PIECES: [f64; 3] = [4.0, 8.0, 3.0];
/// Slant of a footprint, in texels, below which the footprint is treated as a rectangle.
const STRAIGHT: f64 = 1e-2;
/// Minimum footprint size in texels.
const NARROWEST: f64 = 1e-3;

/// Albedo over the unit square, with u to the right and v down; the square is repeated.
pub(crate) struct Texture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Sum of all texels to the left of and above each of (width + 1) x (height + 1) corners.
    pub(crate) sums: Vec<f64>,
}

impl Texture {
    /// Reads an sRGB image; its luminance is the albedo.
    ///
    /// # Errors
    /// Returns an error if [`texels`] fails.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let (width, height, albedo) = texels(path)?;
        Ok(Self::new(width, height, albedo.into_iter()))
    }

    /// Creates a texture from row-major albedos, at least one.
    pub(crate) fn new(width: usize, height: usize, mut albedo: impl Iterator<Item = f64>) -> Self {
        let stride = width + 1;
        let mut sums = vec![0.0; stride * (height + 1)];
        for y in 0..height {
            let mut row = 0.0;
            for x in 0..width {
                row += albedo.next().unwrap_or(0.0);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
            }
        }
        Self {
            width,
            height,
            sums,
        }
    }

    /// Returns the mean albedo over the parallelogram with centre `uv` and sides `across` and
    /// `down`, in units of the texture's size.
    pub(crate) fn average(&self, uv: DVec2, across: DVec2, down: DVec2) -> f64 {
        let size = DVec2::new(self.width as f64, self.height as f64);
        let (center, a, b) = (uv * size, across * size, down * size);
        if !(center.is_finite() && a.is_finite() && b.is_finite()) {
            return self.sum(self.width as f64, self.height as f64) / (size.x * size.y);
        }
        let slant = a.x.abs().max(b.y.abs()).min(a.y.abs().max(b.x.abs()));
        let extent = DVec2::new(a.x.hypot(b.x), a.y.hypot(b.y));
        let n = if slant < STRAIGHT {
            1
        } else {
            let [fewest, most, per_texel] = PIECES;
            (extent.max_element() * per_texel)
                .ceil()
                .clamp(fewest, most) as usize
        };
        let part = 1.0 / n as f64;
        // Half sides of the rectangle that replaces a piece.
        let half = extent * part / 2.0;
        let half = half.max(DVec2::splat(NARROWEST / 2.0));
        let piece = |k: usize| {
            let s = ((k % n) as f64 + 0.5) * part - 0.5;
            let t = ((k / n) as f64 + 0.5) * part - 0.5;
            self.rectangle(center + a * s + b * t, half)
        };
        (0..n * n).map(piece).sum::<f64>() * part * part
    }

    /// Returns the exact mean over a rectangle aligned with the texels.
    fn rectangle(&self, center: DVec2, half: DVec2) -> f64 {
        let size = DVec2::new(self.width as f64, self.height as f64);
        let low = center - half;
        // Shifts the rectangle so that it starts in the tile at the origin.
        let low = low - (low / size).floor() * size;
        let high = low + 2.0 * half;
        let total = self.sum(high.x, high.y) - self.sum(low.x, high.y) - self.sum(high.x, low.y)
            + self.sum(low.x, low.y);
        total / (4.0 * half.x * half.y)
    }

    /// Returns the integral of the repeated texture from the origin to a point.
    fn sum(&self, x: f64, y: f64) -> f64 {
        let (w, h) = (self.width as f64, self.height as f64);
        let (i, j) = ((x / w).floor(), (y / h).floor());
        let (x, y) = ((x - i * w).clamp(0.0, w), (y - j * h).clamp(0.0, h));
        let mut sum = self.within(x, y);
        if i > 0.0 {
            sum += i * self.within(w, y);
        }
        if j > 0.0 {
            sum += j * self.within(x, h);
        }
        if i > 0.0 && j > 0.0 {
            sum += i * j * self.within(w, h);
        }
        sum
    }

    /// Returns the integral of one copy of the texture from the origin to a point; it is bilinear
    /// between corners because texels are constant.
    fn within(&self, x: f64, y: f64) -> f64 {
        let (i, j) = (
            (x as usize).min(self.width - 1),
            (y as usize).min(self.height - 1),
        );
        let (s, t) = (x - i as f64, y - j as f64);
        let row = |j: usize| {
            let at = j * (self.width + 1) + i;
            self.sums[at] + s * (self.sums[at + 1] - self.sums[at])
        };
        row(j) + t * (row(j + 1) - row(j))
    }
}

/// Returns columns, rows and texel albedos of an image, row by row.
///
/// # Errors
/// Returns an error if the file cannot be read, is not an image, or is too large.
pub(crate) fn texels(path: &Path) -> Result<(usize, usize, Vec<f64>)> {
    let place = path.display().to_string();
    let bytes = image_file::bytes_of(path)?;
    let allowed =
        format!("a PNG, BMP, TIFF or JPEG file of at most {MAX_SIDE} x {MAX_SIDE} pixels");
    let bad = |e: &dyn std::fmt::Display| Error::input(&place, e, &allowed);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| bad(&e))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(u64::from(MAX_SIDE * MAX_SIDE) * 16);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| bad(&e))?.into_rgb16();
    let linear: Vec<f64> = (0..=u16::MAX)
        .map(|v| colour::linear(f64::from(v) / 65535.0))
        .collect();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let albedo = picture
        .pixels()
        .map(|p| colour::luminance(p.0.map(|c| linear[usize::from(c)])));
    Ok((width, height, albedo.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker(n: usize) -> Texture {
        Texture::new(n, n, (0..n * n).map(|k| ((k % n + k / n) % 2) as f64))
    }

    /// Returns the mean of 4096 nearest-texel samples.
    fn sampled(n: usize, uv: DVec2, across: DVec2, down: DVec2) -> f64 {
        let mut sum = 0.0;
        for k in 0..4096 {
            let (s, t) = (f64::from(k % 64) + 0.5, f64::from(k / 64) + 0.5);
            let p = uv + across * (s / 64.0 - 0.5) + down * (t / 64.0 - 0.5);
            let cell = (p * n as f64).floor();
            sum += (cell.x + cell.y).rem_euclid(2.0);
        }
        sum / 4096.0
    }

    #[test]
    fn average_of_checkerboard_matches_4096_samples() {
        let n = 16;
        let texture = checker(n);
        let texel = 1.0 / n as f64;
        let (mut straight, mut slanted, mut off) = (0.0f64, 0.0f64, 0);
        for k in 0..400 {
            let f = |a: f64| (f64::from(k) * a).fract();
            let uv = DVec2::new(5.0 * f(0.618) - 2.0, 5.0 * f(0.414) - 2.0);
            let (w, h) = (
                texel * (0.1 + 3.0 * f(0.732)),
                texel * (0.1 + 3.0 * f(0.236)),
            );
            let (a, b) = (DVec2::new(w, 0.0), DVec2::new(0.0, -h));
            let error = texture.average(uv, a, b) - sampled(n, uv, a, b);
            straight = straight.max(error.abs());
            let turn = DVec2::from_angle(std::f64::consts::TAU * f(0.303));
            let (a, b) = (turn.rotate(a), turn.rotate(b + 0.3 * a));
            let error = texture.average(uv, a, b) - sampled(n, uv, a, b);
            slanted = slanted.max(error.abs());
            off += usize::from(error.abs() > 0.02);
        }
        // Sampling is accurate to 1/64 for a footprint that an edge crosses.
        assert!(straight < 0.02, "{straight}");
        assert!(slanted < 0.06 && off <= 20, "{slanted}, {off} of 400");
    }

    #[test]
    fn far_repeats_wide_footprints_and_no_numbers_have_the_mean() {
        let texture = checker(6);
        let wide = texture.average(DVec2::splat(0.3), DVec2::X * 1e4, DVec2::Y * 1e4);
        assert!((wide - 0.5).abs() < 1e-6, "{wide}");
        let far = texture.average(
            DVec2::splat(1e6 + 0.25 / 6.0),
            DVec2::X / 60.0,
            DVec2::Y / 60.0,
        );
        assert!(far.abs() < 1e-4, "{far}");
        assert_eq!(texture.average(DVec2::NAN, DVec2::X, DVec2::Y), 0.5);
    }
}
