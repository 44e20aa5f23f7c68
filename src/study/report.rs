//! What a demo leaves behind: pictures of depth and error, and figures.

use super::score::{Score, depth_errors};
use image::{GrayImage, Rgb, RgbImage};
use phasmid_core::error::Result;
use phasmid_core::new_file::replace_image;
use phasmid_decode::Decoded;
use phasmid_geometry::Rig;
use phasmid_render::truth::Truth;
use phasmid_report::map_image;
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// The pictures that [`write_images`] makes.
pub const PICTURES: [&str; 3] = ["depth.png", "error.png", "overview.png"];

/// The figures of a demo, as `summary.json` holds them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// `phasmid demo` and its version: marks a folder as a demo's.
    pub made_by: String,
    /// `*IDN?` of the device.
    pub device: String,
    /// Profile as it was chosen.
    pub profile: String,
    /// Scene as it was chosen.
    pub scene: String,
    /// Seed of the noise.
    pub seed: u64,
    /// Whether the sensor's noise was on.
    pub noise: bool,
    /// Frames captured.
    pub frames: usize,
    /// Errors against the truth.
    #[serde(flatten)]
    pub score: Score,
    /// Pixels left out of the cloud, by reason.
    pub masked: Vec<(&'static str, usize)>,
    /// Seconds that the device spent on rendering the frames.
    pub render_s: f64,
    /// Seconds from opening the device to the last frame.
    pub capture_s: f64,
    /// Seconds from frames to points.
    pub decode_s: f64,
    /// Seconds of the whole run, starting the device and writing files included.
    pub total_s: f64,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.score;
        let c = &s.crease;
        writeln!(
            f,
            "{} before {}, {} frames",
            self.profile, self.scene, self.frames
        )?;
        writeln!(f)?;
        writeln!(f, "{:<26}{:>12}{:>14}", "", "surface", "at creases")?;
        let points = s.points - c.points;
        writeln!(f, "{:<26}{:>12}{:>14}", "points", points, c.points)?;
        let mut percent = |name, a: f64, b: f64| {
            let share = |v: f64| cell(100.0 * v, 3, "%");
            writeln!(f, "{name:<26}{:>12}{:>14}", share(a), share(b))
        };
        percent("coverage", s.coverage, c.coverage)?;
        percent(
            "gross errors (> 1 mm)",
            s.gross_error_rate,
            c.gross_error_rate,
        )?;
        let mut mm = |name, a: f64, b: Option<f64>| {
            let b = b.map_or(String::new(), |b| cell(b, 4, "mm"));
            let line = format!("{name:<26}{:>12}{b:>14}", cell(a, 4, "mm"));
            writeln!(f, "{}", line.trim_end())
        };
        mm("inlier RMS error", s.inlier_rmse_mm, Some(c.inlier_rmse_mm))?;
        mm("mean absolute error", s.mae_mm, Some(c.mae_mm))?;
        mm("Hausdorff distance", s.hausdorff_mm, None)?;
        mm("mean distance to agreement", s.mdta_mm, None)?;
        mm("noise bound", s.bound_mm, None)?;
        writeln!(
            f,
            "{:<26}{:>12}",
            "error over bound",
            cell(s.ratio_to_bound, 3, "")
        )?;
        for (reason, pixels) in self.masked.iter().filter(|(_, pixels)| *pixels > 0) {
            writeln!(f, "{:<26}{pixels:>12}", format!("left out, {reason}"))?;
        }
        writeln!(f)?;
        writeln!(
            f,
            "rendered in {:.2} s, captured in {:.2} s, decoded in {:.3} s, {:.1} s in all",
            self.render_s, self.capture_s, self.decode_s, self.total_s
        )
    }
}

/// A number with its unit, or a dash where there is none.
fn cell(value: f64, digits: usize, unit: &str) -> String {
    if value.is_finite() {
        format!("{value:.digits$} {unit}").trim_end().to_owned()
    } else {
        "-".to_owned()
    }
}

/// Writes `depth.png`, the measured surface in colour and relief, `error.png`, measured minus true
/// depth, each with a scale, and `overview.png`: `frame`, what the camera saw, above the two, all
/// cut to what was measured.
///
/// # Errors
/// What the system refuses.
pub fn write_images(
    folder: &Path,
    frame: &GrayImage,
    decoded: &Decoded,
    truth: &Truth,
    rig: &Rig,
) -> Result<()> {
    let (width, height) = (decoded.width as u32, decoded.height as u32);
    let maps = Maps::new(decoded, truth, rig);
    let depth = map_image::colour_mapped_relief(
        width,
        height,
        &decoded.depth,
        &maps.shade,
        maps.range,
        "mm",
    );
    save(&depth, &folder.join(PICTURES[0]))?;
    let error = map_image::diverging(width, height, &maps.errors, maps.limit, "mm");
    save(&error, &folder.join(PICTURES[1]))?;
    let overview = maps.overview(frame, decoded);
    save(&overview, &folder.join(PICTURES[2]))
}

/// What `overview.png` shows: `frame`, what the camera saw, above depth and error, all cut to what
/// was measured.
pub fn overview(frame: &GrayImage, decoded: &Decoded, truth: &Truth, rig: &Rig) -> RgbImage {
    Maps::new(decoded, truth, rig).overview(frame, decoded)
}

/// What pictures of a scan show, and their scales.
struct Maps {
    shade: Vec<f32>,
    range: (f32, f32),
    errors: Vec<f32>,
    limit: f32,
}

impl Maps {
    fn new(decoded: &Decoded, truth: &Truth, rig: &Rig) -> Self {
        let (width, height) = (decoded.width as u32, decoded.height as u32);
        let focal = rig.camera.lens.focal_px.x as f32;
        let errors = depth_errors(decoded, truth);
        let sizes: Vec<f32> = errors.iter().map(|e| e.abs()).collect();
        Self {
            shade: map_image::shades(width, height, &decoded.depth, focal),
            range: quantiles(&decoded.depth, 0.001, 0.999).unwrap_or((0.0, 1.0)),
            errors,
            // Four out of a hundred go beyond the scale's end, so that the rest is told apart.
            limit: quantiles(&sizes, 0.0, 0.96).map_or(1.0, |(_, high)| high.max(1e-4)),
        }
    }

    fn overview(&self, frame: &GrayImage, decoded: &Decoded) -> RgbImage {
        let (width, height) = (decoded.width as u32, decoded.height as u32);
        let area = Area::around(&decoded.depth, width, height);
        let wide = (area.width * ZOOM, area.height * ZOOM);
        let enlarged = |values: &[f32]| area.enlarge(&area.cut(values));
        let depth = map_image::colour_mapped_relief(
            wide.0,
            wide.1,
            &enlarged(&decoded.depth),
            &enlarged(&self.shade),
            self.range,
            "mm",
        );
        let errors = enlarged(&self.errors);
        let error = map_image::diverging(wide.0, wide.1, &errors, self.limit, "mm");
        stack(&[area.frame(frame), depth, error])
    }
}

/// How many pixels of the overview a pixel of the camera takes, along each side.
const ZOOM: u32 = 2;
/// Pixels of the camera around what was measured.
const MARGIN: u32 = 12;

/// The part of the image that was measured.
struct Area {
    left: u32,
    top: u32,
    width: u32,
    height: u32,
    /// Columns of the whole image.
    stride: u32,
}

impl Area {
    /// The box around the finite values with a margin; all of the image if there are none.
    fn around(values: &[f32], width: u32, height: u32) -> Self {
        let finite = || (0..width * height).filter(|&i| values[i as usize].is_finite());
        let span = |at: &dyn Fn(u32) -> u32, end: u32| {
            let low = finite().map(at).min().unwrap_or(0).saturating_sub(MARGIN);
            let high = finite().map(at).max().unwrap_or(end).saturating_add(MARGIN);
            (low, high.min(end - 1) - low + 1)
        };
        let (left, columns) = span(&|i| i % width, width);
        let (top, rows) = span(&|i| i / width, height);
        Self {
            left,
            top,
            width: columns,
            height: rows,
            stride: width,
        }
    }

    fn cut(&self, values: &[f32]) -> Vec<f32> {
        let at = |y: u32, x: u32| values[((self.top + y) * self.stride + self.left + x) as usize];
        (0..self.height)
            .flat_map(|y| (0..self.width).map(move |x| at(y, x)))
            .collect()
    }

    /// Each value of a cut map `ZOOM` times along each side.
    fn enlarge(&self, values: &[f32]) -> Vec<f32> {
        (0..self.height * ZOOM)
            .flat_map(|y| {
                (0..self.width * ZOOM)
                    .map(move |x| values[(y / ZOOM * self.width + x / ZOOM) as usize])
            })
            .collect()
    }

    fn frame(&self, frame: &GrayImage) -> RgbImage {
        RgbImage::from_fn(self.width * ZOOM, self.height * ZOOM, |x, y| {
            let level = frame.get_pixel(self.left + x / ZOOM, self.top + y / ZOOM).0[0];
            Rgb([level; 3])
        })
    }
}

/// Pictures below one another.
fn stack(pictures: &[RgbImage]) -> RgbImage {
    let width = pictures.iter().map(RgbImage::width).max().unwrap_or(0);
    let height = pictures.iter().map(RgbImage::height).sum();
    let mut out = RgbImage::from_pixel(width, height, Rgb([22, 22, 24]));
    let mut top = 0;
    for picture in pictures {
        image::imageops::replace(&mut out, picture, 0, i64::from(top));
        top += picture.height();
    }
    out
}

fn save(picture: &RgbImage, path: &Path) -> Result<()> {
    replace_image(path, |out| picture.write_to(out, image::ImageFormat::Png))
}

/// Two quantiles of the finite values; `None` without any.
fn quantiles(values: &[f32], low: f64, high: f64) -> Option<(f32, f32)> {
    let mut finite: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
    finite.sort_unstable_by(f32::total_cmp);
    let last = finite.len().checked_sub(1)?;
    let at = |q: f64| finite[(q * last as f64).round() as usize];
    Some((at(low), at(high)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_leave_nan_out() {
        let values: Vec<f32> = (0..=100).map(|i| i as f32).chain([f32::NAN]).collect();
        assert_eq!(quantiles(&values, 0.0, 0.96), Some((0.0, 96.0)));
        assert_eq!(quantiles(&[f32::NAN], 0.0, 1.0), None);
    }
}
