//! The output of a demo: images of depth and error, and figures.

use super::score::{Score, depth_errors};
use image::{GrayImage, Rgb, RgbImage};
use phasmid_core::error::Result;
use phasmid_core::new_file::replace_image;
use phasmid_decode::Decoded;
use phasmid_geometry::Rig;
use phasmid_render::truth::Truth;
use phasmid_report::map_image::{self, Colours, Map};
use phasmid_report::relief;
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// File names of the images that [`write_images`] makes.
pub const PICTURES: [&str; 3] = ["depth.png", "error.png", "overview.png"];

/// Results of a demo, as in `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// `phasmid demo` and its version: marks a folder as a demo's.
    pub made_by: String,
    /// `*IDN?` of the device.
    pub device: String,
    /// Profile as given on the command line.
    pub profile: String,
    /// Scene as given on the command line.
    pub scene: String,
    /// Whether the truth was written to the folder too.
    pub truth: bool,
    /// Seed of the noise.
    pub seed: u64,
    /// Whether the sensor's noise was on.
    pub noise: bool,
    /// `factory` if the decoder used the calibration that the device reports, including its errors;
    /// `exact` if it used the exact rig.
    pub calibration: &'static str,
    /// Median standard deviation of depth that the calibration causes, in mm; `None` if it is exact.
    pub calibration_sigma_mm: Option<f32>,
    /// Number of captured frames.
    pub frames: usize,
    /// Errors against the truth.
    #[serde(flatten)]
    pub score: Score,
    /// Number of pixels rejected from the cloud, by reason.
    pub masked: Vec<(&'static str, usize)>,
    /// Seconds from the start of the program until the device is ready.
    pub start_s: f64,
    /// Seconds that the device spent rendering the frames, mostly within `capture_s`.
    pub render_s: f64,
    /// Seconds from opening the device to the last frame, with rendering and transfer.
    pub capture_s: f64,
    /// Seconds for decoding frames to points.
    pub decode_s: f64,
    /// Seconds for computing the truth and comparing the points with it.
    pub compare_s: f64,
    /// Seconds for the files, without this summary.
    pub write_s: f64,
    /// Seconds of the whole run: the sum of the other durations except `render_s`.
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
        let ratio = cell(s.stated.error_over_sigma, 3, "");
        writeln!(f, "{:<26}{ratio:>12}", "error over sigma")?;
        let beyond = cell(100.0 * s.stated.beyond_5_sigma, 3, "%");
        writeln!(f, "{:<26}{beyond:>12}", "beyond 5 sigma")?;
        let calibration = match self.calibration_sigma_mm {
            Some(sigma) => cell(sigma.into(), 4, "mm"),
            None => self.calibration.to_owned(),
        };
        let name = match self.calibration_sigma_mm {
            Some(_) => format!("{} calibration, sigma", self.calibration),
            None => "calibration".to_owned(),
        };
        writeln!(f, "{name:<26}{calibration:>12}")?;
        for (reason, pixels) in self.masked.iter().filter(|(_, pixels)| *pixels > 0) {
            writeln!(f, "{:<26}{pixels:>12}", format!("left out, {reason}"))?;
        }
        writeln!(f)?;
        let times = [
            ("start", self.start_s),
            ("capture", self.capture_s),
            ("  of that, rendering", self.render_s),
            ("decoding", self.decode_s),
            ("comparison with the truth", self.compare_s),
            ("files", self.write_s),
            ("total time", self.total_s),
        ];
        times
            .into_iter()
            .try_for_each(|(name, s)| writeln!(f, "{name:<26}{:>12}", cell(s, 3, "s")))
    }
}

/// Formats a number with its unit, or a dash if the number is not finite.
fn cell(value: f64, digits: usize, unit: &str) -> String {
    if value.is_finite() {
        format!("{value:.digits$} {unit}").trim_end().to_owned()
    } else {
        "-".to_owned()
    }
}

/// Writes three images, all cut to the measured region: `depth.png` shows the measured surface in colour
/// and relief, `error.png` shows measured minus true depth, and `overview.png` shows the camera image
/// `frame` above depth and error. Each image has a title, a scale with its unit, and a legend for pixels
/// without a measurement.
///
/// # Errors
/// Returns an error if a file cannot be written.
pub fn write_images(
    folder: &Path,
    frame: &GrayImage,
    decoded: &Decoded,
    truth: &Truth,
    rig: &Rig,
) -> Result<()> {
    let maps = Maps::new(decoded, truth, rig);
    let whole = Area {
        left: 0,
        top: 0,
        width: decoded.width as u32,
        height: decoded.height as u32,
        stride: decoded.width as u32,
    };
    let [depth, error] = maps.draw(decoded, &whole, 1);
    save(&depth, &folder.join(PICTURES[0]))?;
    save(&error, &folder.join(PICTURES[1]))?;
    save(&maps.overview(frame, decoded), &folder.join(PICTURES[2]))
}

/// Draws `overview.png`: `frame`, an image of the camera, above depth and error, all cut to the
/// measured region.
pub fn overview(frame: &GrayImage, decoded: &Decoded, truth: &Truth, rig: &Rig) -> RgbImage {
    Maps::new(decoded, truth, rig).overview(frame, decoded)
}

/// Maps of a scan, and their colour scales.
struct Maps {
    shade: Vec<f32>,
    range: (f32, f32),
    errors: Vec<f32>,
    limit: f32,
}

impl Maps {
    fn new(decoded: &Decoded, truth: &Truth, rig: &Rig) -> Self {
        let (width, height) = (decoded.width as u32, decoded.height as u32);
        let focal = rig.camera.lens.focal_px.as_vec2().to_array();
        let errors = depth_errors(decoded, truth);
        let sizes: Vec<f32> = errors.iter().map(|e| e.abs()).collect();
        Self {
            shade: relief::shades(width, height, &decoded.depth, focal),
            range: depth_range(&decoded.depth).unwrap_or((0.0, 1.0)),
            errors,
            // The scale ends at the 96th percentile of the errors, so that the colours resolve the
            // smaller errors.
            limit: quantiles(&sizes, 0.0, 0.96).map_or(1.0, |(_, high)| high.max(1e-4)),
        }
    }

    fn overview(&self, frame: &GrayImage, decoded: &Decoded) -> RgbImage {
        let (width, height) = (decoded.width as u32, decoded.height as u32);
        let area = Area::around(&decoded.depth, width, height);
        let [depth, error] = self.draw(decoded, &area, ZOOM);
        let frame = map_image::titled("Camera image under the first pattern", &area.frame(frame));
        map_image::stacked(&[frame, depth, error])
    }

    /// Draws depth and error within an area.
    fn draw(&self, decoded: &Decoded, area: &Area, zoom: u32) -> [RgbImage; 2] {
        let shade = area.cut(&self.shade);
        let depth = Map {
            title: "Measured depth",
            width: area.width,
            height: area.height,
            values: &area.cut(&decoded.depth),
            unit: "mm",
            colours: Colours::Range(self.range.0, self.range.1),
            relief: Some(&shade),
            zoom,
        };
        let error = Map {
            title: "Measured minus true depth",
            values: &area.cut(&self.errors),
            colours: Colours::Signed(self.limit),
            relief: None,
            ..depth
        };
        [depth.draw(), error.draw()]
    }
}

/// Side of a camera pixel in the overview, in pixels.
const ZOOM: u32 = 2;
/// Width of the margin around the measured region, in camera pixels.
const MARGIN: u32 = 12;

/// A rectangle of the image.
struct Area {
    left: u32,
    top: u32,
    width: u32,
    height: u32,
    /// Columns of the whole image.
    stride: u32,
}

impl Area {
    /// Returns the bounding box of the finite values with a margin; the whole image if there are none.
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

    fn frame(&self, frame: &GrayImage) -> RgbImage {
        RgbImage::from_fn(self.width * ZOOM, self.height * ZOOM, |x, y| {
            let level = frame.get_pixel(self.left + x / ZOOM, self.top + y / ZOOM).0[0];
            Rgb([level; 3])
        })
    }
}

fn save(image: &RgbImage, path: &Path) -> Result<()> {
    replace_image(path, |out| image.write_to(out, image::ImageFormat::Png))
}

/// Returns the range of depths for the colours. A background that is separated from the object by a gap
/// in depth is left out, so that the colours resolve the object.
///
/// The gap is the longest run of empty bins among [`BINS`] between the quantiles 0.001 and 0.999, where
/// bins with fewer than one in 5000 values count as empty.
fn depth_range(depth: &[f32]) -> Option<(f32, f32)> {
    let (low, high) = quantiles(depth, 0.001, 0.999)?;
    if low == high {
        return Some((low, high));
    }
    let mut bins = [0_usize; BINS];
    let mut all = 0;
    for v in depth.iter().filter(|v| v.is_finite()) {
        let t = ((v - low) / (high - low)).clamp(0.0, 1.0);
        bins[((t * BINS as f32) as usize).min(BINS - 1)] += 1;
        all += 1;
    }
    let empty = |i: usize| bins[i] <= all / 5000;
    let mut gap = 0..0;
    let mut begin = 0;
    for i in 0..BINS {
        if !empty(i) {
            begin = i + 1;
        } else if i + 1 - begin > gap.len() {
            gap = begin..i + 1;
        }
    }
    let nearer: usize = bins[..gap.start].iter().sum();
    if gap.len() < SHORTEST_GAP || nearer < all / 20 {
        return Some((low, high));
    }
    let end = low + (high - low) * gap.start as f32 / BINS as f32;
    let object: Vec<f32> = depth.iter().copied().filter(|v| *v < end).collect();
    quantiles(&object, 0.001, 0.999)
}

/// Bins of the histogram of depths.
const BINS: usize = 100;
/// Minimum length of the gap before a background, in bins.
const SHORTEST_GAP: usize = 10;

/// Returns two quantiles of the finite values; `None` if no value is finite.
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
    #[test]
    fn the_range_of_depths_leaves_out_a_background_behind_a_gap() {
        let object = (0..500).map(|i| 900.0 + 0.3 * i as f32);
        let wall = std::iter::repeat_n(1150.0, 800);
        let both: Vec<f32> = object.clone().chain(wall).collect();
        let (low, high) = depth_range(&both).unwrap();
        assert!(
            low < 901.0 && (1048.0..1050.0).contains(&high),
            "{low} {high}"
        );
        let only: Vec<f32> = object.collect();
        let (low, high) = depth_range(&only).unwrap();
        assert!(low < 901.0 && high > 1048.0, "{low} {high}");
        assert_eq!(depth_range(&[7.0; 30]), Some((7.0, 7.0)));
        assert_eq!(depth_range(&[f32::NAN]), None);
    }
}
