//! Draws maps as images: in colours with a scale beside them, and as shaded relief.
//!
//! Values are row-major, `width * height` of them. NaN is drawn in dark grey. If there are fewer values
//! than pixels, the missing ones count as NaN.

use crate::colour::Scale;
use crate::font;
use image::{Rgb, RgbImage};

const NOTHING: [u8; 3] = [38, 38, 40];
const PAPER: [u8; 3] = [22, 22, 24];
const INK: [u8; 3] = [225, 225, 225];

/// Draws a map of values from `range.0` (dark) to `range.1` (light) in `unit`, with its scale at the
/// right, which makes the image wider than the map.
pub fn colour_mapped(
    width: u32,
    height: u32,
    values: &[f32],
    range: (f32, f32),
    unit: &str,
) -> RgbImage {
    mapped(width, height, values, None, range, unit, &Scale::sizes())
}

/// Draws a map like [`colour_mapped`], with shading: `shade` is the result of [`shades`], with NaN as
/// full light. Colour shows the value and shading the shape. The darkest shade halves a colour, so that
/// it remains recognisable.
pub fn colour_mapped_relief(
    width: u32,
    height: u32,
    values: &[f32],
    shade: &[f32],
    range: (f32, f32),
    unit: &str,
) -> RgbImage {
    mapped(
        width,
        height,
        values,
        Some(shade),
        range,
        unit,
        &Scale::sizes(),
    )
}

/// Draws a map of signed values, from `-limit` (blue) over 0 (light grey) to `limit` (red) in `unit`, with
/// its scale at the right.
pub fn diverging(width: u32, height: u32, values: &[f32], limit: f32, unit: &str) -> RgbImage {
    let limit = limit.abs();
    mapped(
        width,
        height,
        values,
        None,
        (-limit, limit),
        unit,
        &Scale::signs(),
    )
}

/// Draws a depth map in millimetres as shaded relief, in grey, without a scale. `focal_px` is the
/// camera's focal length in pixels.
pub fn shaded(width: u32, height: u32, depth_mm: &[f32], focal_px: f32) -> RgbImage {
    let shade = shades(width, height, depth_mm, focal_px);
    RgbImage::from_fn(width, height, |x, y| {
        let s = value(&shade, width, x, y);
        Rgb(if s.is_finite() {
            [(40.0 + 210.0 * s) as u8; 3]
        } else {
            NOTHING
        })
    })
}

/// Computes the brightness of each pixel of a depth map under a lamp at the upper left, 0 to 1; NaN for
/// pixels without depth, or without a neighbour along x or y. The surface is Lambertian, with 12 %
/// ambient light.
///
/// The normal is (dz/du, dz/dv, -z / focal_px): depth as a height over the image, with the width of a
/// pixel at its depth. Derivatives are differences between neighbours.
pub fn shades(width: u32, height: u32, depth_mm: &[f32], focal_px: f32) -> Vec<f32> {
    const LAMP: [f32; 3] = [-0.45, -0.6, -0.66];
    let z = |x: u32, y: u32| value(depth_mm, width, x, y);
    // Central difference if both neighbours are known, one-sided if one is.
    let slope = |before: Option<f32>, here: f32, after: Option<f32>| {
        let known = |v: Option<f32>| v.filter(|v| v.is_finite());
        match (known(before), known(after)) {
            (Some(a), Some(b)) => (b - a) / 2.0,
            (Some(a), None) => here - a,
            (None, Some(b)) => b - here,
            (None, None) => f32::NAN,
        }
    };
    let mut out = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let here = z(x, y);
            let across = slope(
                x.checked_sub(1).map(|x| z(x, y)),
                here,
                (x + 1 < width).then(|| z(x + 1, y)),
            );
            let down = slope(
                y.checked_sub(1).map(|y| z(x, y)),
                here,
                (y + 1 < height).then(|| z(x, y + 1)),
            );
            let normal = [across, down, -here / focal_px];
            let length = normal.iter().map(|n| n * n).sum::<f32>().sqrt();
            let lit = normal.iter().zip(LAMP).map(|(n, l)| n * l).sum::<f32>() / length;
            out.push(if lit.is_nan() {
                lit
            } else {
                0.12 + 0.88 * lit.max(0.0)
            });
        }
    }
    out
}

fn value(values: &[f32], width: u32, x: u32, y: u32) -> f32 {
    let at = y as usize * width as usize + x as usize;
    values.get(at).copied().unwrap_or(f32::NAN)
}

fn mapped(
    width: u32,
    height: u32,
    values: &[f32],
    shade: Option<&[f32]>,
    range: (f32, f32),
    unit: &str,
    scale: &Scale,
) -> RgbImage {
    let bar = Bar::new(height, range, unit);
    let mut image = RgbImage::from_pixel(width + bar.width(), height, Rgb(PAPER));
    let (low, high) = range;
    // With an empty range, all values get the middle colour.
    let span = high - low;
    for y in 0..height {
        for x in 0..width {
            let v = value(values, width, x, y);
            let t = if span > 0.0 { (v - low) / span } else { 0.5 };
            let colour = if v.is_nan() || t.is_nan() {
                NOTHING
            } else {
                let s = shade.map_or(1.0, |s| value(s, width, x, y));
                // A surface that faces the camera has a shade of 0.7 and keeps nearly all its colour.
                let light = if s.is_nan() {
                    1.0
                } else {
                    (0.45 + 0.75 * s).clamp(0.5, 1.0)
                };
                scale.at(t).map(|c| (f32::from(c) * light).round() as u8)
            };
            image.put_pixel(x, y, Rgb(colour));
        }
    }
    bar.draw(&mut image, width, scale);
    image
}

/// The scale at the right: a strip of colours with ticks at round values and the unit above.
struct Bar {
    dot: u32,
    range: (f32, f32),
    ticks: Vec<(f32, String)>,
    unit: String,
}

impl Bar {
    fn new(height: u32, range: (f32, f32), unit: &str) -> Self {
        let dot = (height / 160).clamp(1, 6);
        Self {
            dot,
            range,
            ticks: ticks(range, 3 + (height / (40 * dot)).min(6)),
            unit: unit.chars().take(12).collect(),
        }
    }

    fn width(&self) -> u32 {
        let widest = self.ticks.iter().map(|t| t.1.as_str()).chain([&*self.unit]);
        let label = widest.map(|t| font::size(t, self.dot).0).max().unwrap_or(0);
        label + 20 * self.dot
    }

    fn draw(&self, image: &mut RgbImage, left: u32, scale: &Scale) {
        let dot = self.dot;
        let (strip, thick) = (left + 4 * dot, 8 * dot);
        let (top, bottom) = (12 * dot, image.height().saturating_sub(6 * dot));
        if bottom <= top + 8 * dot {
            return;
        }
        let rows = (bottom - top) as f32;
        for y in top..bottom {
            let colour = scale.at(1.0 - (y - top) as f32 / (rows - 1.0));
            for x in strip..strip + thick {
                image.put_pixel(x, y, Rgb(colour));
            }
        }
        font::draw(image, &self.unit, (strip, 4 * dot), dot, INK);
        let (low, high) = self.range;
        for (at, text) in &self.ticks {
            let t = if high > low {
                (at - low) / (high - low)
            } else {
                0.5
            };
            let y = top + ((1.0 - t) * (rows - 1.0)).round() as u32;
            for x in strip + thick..strip + thick + 2 * dot {
                image.put_pixel(x, y, Rgb(INK));
            }
            let (_, tall) = font::size(text, dot);
            let place = (strip + thick + 4 * dot, y.saturating_sub(tall / 2));
            font::draw(image, text, place, dot, INK);
        }
    }
}

/// Returns about `count` round values within a range, 1, 2 or 5 times a power of ten apart, with as many
/// decimals as distinguish them.
fn ticks((low, high): (f32, f32), count: u32) -> Vec<(f32, String)> {
    let (low, high) = (f64::from(low), f64::from(high));
    let span = high - low;
    if !(low.is_finite() && high.is_finite()) {
        return Vec::new();
    }
    if span <= 0.0 {
        return vec![(low as f32, format!("{low}").chars().take(9).collect())];
    }
    let rough = span / f64::from(count.max(1));
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|m| m * power)
        .into_iter()
        .find(|s| *s >= rough * 0.999)
        .unwrap_or(10.0 * power);
    let decimals = (-step.log10()).ceil().clamp(0.0, 9.0) as usize;
    let first = (low / step - 1e-6).ceil();
    let last = (high / step + 1e-6).floor();
    // A step that is small relative to the values is lost in rounding.
    if last - first >= 100.0 {
        return Vec::new();
    }
    (0..=(last - first) as u32)
        .map(|k| {
            let at = (first + f64::from(k)) * step;
            // Adding zero turns -0 into 0.
            (
                at.clamp(low, high) as f32,
                format!("{:.decimals$}", at + 0.0),
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(range: (f32, f32), count: u32) -> Vec<String> {
        ticks(range, count).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(
            labels((0.0, 1.0), 5),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        let around_zero = labels((-0.05, 0.05), 4);
        assert_eq!(around_zero, ["-0.05", "0.00", "0.05"]);
        assert_eq!(labels((780.0, 1003.0), 4), ["800", "900", "1000"]);
        assert_eq!(labels((3.0, 3.0), 4), ["3"]);
        assert!(labels((f32::NAN, 1.0), 4).is_empty());
        assert!(labels((0.0, f32::INFINITY), 4).is_empty());
        assert!(labels((1.0, 1.0 + f32::EPSILON), 4).len() < 100);
    }

    #[test]
    fn values_are_coloured_and_nan_is_dark() {
        let (width, height) = (64, 200);
        let mut values: Vec<f32> = (0..width * height).map(|i| (i % width) as f32).collect();
        values[5] = f32::NAN;
        let image = colour_mapped(width, height, &values, (0.0, 63.0), "mm");
        assert_eq!(image.get_pixel(5, 0).0, NOTHING);
        let scale = Scale::sizes();
        assert_eq!(image.get_pixel(0, 3).0, scale.at(0.0));
        assert_eq!(image.get_pixel(63, 3).0, scale.at(1.0));
        // The ends of the strip have the colours of the ends of the scale.
        assert!(image.width() > width && image.height() == height);
        let strip = width + 6;
        assert_eq!(image.get_pixel(strip, 12).0, scale.at(1.0));
        assert_eq!(image.get_pixel(strip, height - 7).0, scale.at(0.0));
        let ink = image.pixels().filter(|p| p.0 == INK).count();
        assert!(ink > 40, "{ink}");
    }

    #[test]
    fn nothing_odd_breaks_it() {
        for (width, height) in [(0, 0), (1, 1), (3, 30), (2, 700)] {
            let values = vec![f32::INFINITY; (width * height / 2) as usize];
            for range in [(0.0, 0.0), (1.0, -1.0), (f32::NAN, 0.0), (-1e38, 1e38)] {
                colour_mapped(width, height, &values, range, "very long unit \u{3bc}");
                colour_mapped_relief(width, height, &values, &values, range, "");
            }
            diverging(width, height, &values, f32::NAN, "mm");
            shaded(width, height, &values, 600.0);
        }
    }

    #[test]
    fn a_plane_is_evenly_lit_and_slopes_differ() {
        let flat = vec![1000.0; 20 * 20];
        let shade = shades(20, 20, &flat, 500.0);
        assert!(shade.iter().all(|s| (s - shade[0]).abs() < 1e-6));
        // The surface rises towards the camera to the right, so it faces the lamp at the left.
        let tilt = |sign: f32| -> Vec<f32> {
            let z: Vec<f32> = (0..400).map(|i| 1000.0 - sign * (i % 20) as f32).collect();
            shades(20, 20, &z, 500.0)
        };
        assert!(tilt(1.0)[210] > shade[0] && tilt(-1.0)[210] < shade[0]);
        let hole = [1000.0, f32::NAN, 1000.0, 1000.0];
        assert!(shades(2, 2, &hole, 500.0)[1].is_nan());
    }
}
