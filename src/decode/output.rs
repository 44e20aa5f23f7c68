//! Writes the output files of a decoding, and computes its summary table.

use super::decoder::Decoder;
use super::maps::{Decoded, Verdict};
use super::triangulate::{Lit, Measured};
use image::{GrayImage, Luma, Rgb, RgbImage};
use phasmid_core::error::Result;
use phasmid_core::new_file::replace_image;
use phasmid_core::npy::write_npy;
use phasmid_core::statistics::finite_median;
use phasmid_geometry::ply;
use phasmid_pattern::Axis;
use rayon::prelude::*;
use serde::Serialize;
use std::path::Path;

/// Returns the name of every file that [`write_outputs`] may write.
pub const fn output_names() -> &'static [&'static str] {
    &[
        "projector_x.npy",
        "projector_y.npy",
        "sigma_x.npy",
        "sigma_y.npy",
        "sampling_x.npy",
        "sampling_y.npy",
        "modulation.npy",
        "mask.png",
        "phase_x.png",
        "phase_y.png",
        "depth.npy",
        "cloud.ply",
    ]
}

/// Writes the maps of a decoding into `folder`, which must exist. For each decoded axis (`x` or `y`)
/// these are `projector_x.npy`, `sigma_x.npy`, `phase_x.png` and, unless the error due to held projector
/// pixels is negligible, `sampling_x.npy`. In addition it writes `modulation.npy`, `mask.png` and, with
/// a rig, `depth.npy` and `cloud.ply`. Returns the names of the files written.
///
/// # Errors
/// Returns an error if a file cannot be written.
pub fn write_outputs(
    folder: &Path,
    decoder: &Decoder,
    decoded: &Decoded,
) -> Result<Vec<&'static str>> {
    type Task<'a> = (&'static str, Box<dyn Fn(&Path) -> Result<()> + Sync + 'a>);
    let (width, height) = (decoded.width, decoded.height);
    let mut tasks: Vec<Task<'_>> = Vec::new();
    let array = |values: &'_ [f32], path: &Path| write_npy(path, width, height, values);
    for (axis, map) in decoded.axes() {
        let [projector, sigma, sampling, phase] = match axis {
            Axis::X => [
                "projector_x.npy",
                "sigma_x.npy",
                "sampling_x.npy",
                "phase_x.png",
            ],
            Axis::Y => [
                "projector_y.npy",
                "sigma_y.npy",
                "sampling_y.npy",
                "phase_y.png",
            ],
        };
        let period = decoder
            .plan()
            .axis(axis)
            .and_then(|a| a.sets.first())
            .map(|s| s.period_px as f32);
        tasks.push((projector, Box::new(move |p| array(&map.coordinate, p))));
        tasks.push((sigma, Box::new(move |p| array(&map.sigma, p))));
        if !map.sampling.is_empty() {
            tasks.push((sampling, Box::new(move |p| array(&map.sampling, p))));
        }
        tasks.push((
            phase,
            Box::new(move |p| save(p, phase_image(width, &map.coordinate, period))),
        ));
    }
    tasks.push((
        "modulation.npy",
        Box::new(move |p| array(&decoded.modulation, p)),
    ));
    tasks.push((
        "mask.png",
        Box::new(move |p| {
            let mask = GrayImage::from_fn(width as u32, height as u32, |u, v| {
                let valid = decoded.is_valid(v as usize * width + u as usize);
                Luma([if valid { 255 } else { 0 }])
            });
            save(p, mask.into())
        }),
    ));
    if decoder.triangulator().is_some() {
        tasks.push(("depth.npy", Box::new(move |p| array(&decoded.depth, p))));
        tasks.push((
            "cloud.ply",
            Box::new(move |p| ply::write_cloud(p, &decoder.cloud(decoded))),
        ));
    }
    tasks
        .par_iter()
        .map(|(name, task)| task(&folder.join(name)).map(|()| *name))
        .collect()
}

fn save(path: &Path, image: image::DynamicImage) -> Result<()> {
    replace_image(path, |out| image.write_to(out, image::ImageFormat::Png))
}

/// The phase of the finest fringes as hue, black where invalid; for Gray code alone, the coordinate
/// modulo 64 px.
fn phase_image(width: usize, coordinate: &[f32], period: Option<f32>) -> image::DynamicImage {
    let period = period.unwrap_or(64.0);
    let height = coordinate.len() / width;
    RgbImage::from_fn(width as u32, height as u32, |u, v| {
        let x = coordinate[v as usize * width + u as usize];
        if x.is_nan() {
            return Rgb([0; 3]);
        }
        let hue = (x / period).rem_euclid(1.0) * 6.0;
        let level = |shift: f32| {
            let h = (hue + shift).rem_euclid(6.0);
            (255.0 * (2.0 - (h - 3.0).abs()).clamp(0.0, 1.0)) as u8
        };
        // Each colour channel is at its maximum over a third of the hue circle.
        Rgb([level(3.0), level(1.0), level(5.0)])
    })
    .into()
}

/// Summary of a decoding: coverage, precision, and rejected pixels by reason.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Number of frames in the sequence.
    pub frames: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Number of pixels in an image.
    pub pixels: usize,
    /// Summary of each axis.
    pub axes: Vec<AxisSummary>,
    /// Median modulation B in DN over the pixels valid on the first axis.
    pub median_modulation_dn: Option<f32>,
    /// Number of points; `None` without a rig.
    pub points: Option<usize>,
    /// Median standard deviation of depth in mm, due to noise and held projector pixels; `None`
    /// without a rig.
    pub median_depth_sigma_mm: Option<f32>,
    /// Median standard deviation of depth in mm, due to the calibration, over up to 200 points;
    /// `None` without a covariance of the calibration or if depth was not triangulated. Neighbouring
    /// points have this error in common.
    pub median_calibration_sigma_mm: Option<f32>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Summary of one axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisSummary {
    /// The axis.
    pub axis: Axis,
    /// Number of pixels with a coordinate.
    pub valid: usize,
    /// Median standard deviation due to noise in projector pixels.
    pub median_sigma_px: Option<f32>,
    /// Median uncertainty due to held projector pixels, in projector pixels; 0 if negligible.
    pub median_sampling_px: Option<f32>,
    /// Number of rejected pixels by reason.
    pub masked: Vec<(&'static str, usize)>,
}

impl Summary {
    /// Computes the summary of a decoding.
    pub fn new(decoder: &Decoder, decoded: &Decoded) -> Self {
        let axes: Vec<_> = decoded
            .axes()
            .map(|(axis, map)| {
                let counts = Verdict::ALL.map(|verdict| map.count(verdict));
                AxisSummary {
                    axis,
                    valid: counts[0],
                    median_sigma_px: finite_median(map.sigma.iter().copied()),
                    median_sampling_px: match map.sampling.is_empty() {
                        true => Some(0.0).filter(|_| counts[0] > 0),
                        false => finite_median(map.sampling.iter().copied()),
                    },
                    masked: Verdict::ALL
                        .iter()
                        .zip(counts)
                        .skip(1)
                        .map(|(v, n)| (v.name(), n))
                        .collect(),
                }
            })
            .collect();
        let first = decoded.axes().next().map(|(_, map)| map);
        let valid = first
            .iter()
            .flat_map(|m| &m.verdict)
            .zip(&decoded.modulation);
        let with_rig = decoder.triangulator().is_some();
        Self {
            frames: decoder.plan().frames,
            width: decoded.width,
            height: decoded.height,
            pixels: decoded.width * decoded.height,
            axes,
            median_modulation_dn: finite_median(
                valid
                    .filter(|(v, _)| **v == Verdict::Valid)
                    .map(|(_, m)| *m),
            ),
            points: with_rig.then(|| decoded.depth.iter().filter(|z| !z.is_nan()).count()),
            median_depth_sigma_mm: finite_median(decoded.depth_sigma.iter().copied()),
            median_calibration_sigma_mm: calibration_sigma(decoder, decoded),
            notes: decoded.notes.clone(),
        }
    }
}

/// Maximum number of points at which the uncertainty due to the calibration is computed.
const CALIBRATION_POINTS: usize = 200;

fn calibration_sigma(decoder: &Decoder, decoded: &Decoded) -> Option<f32> {
    let triangulator = decoder.triangulator().filter(|_| !decoded.mapped)?;
    let valid: Vec<usize> = (0..decoded.depth.len())
        .filter(|i| !decoded.depth[*i].is_nan())
        .collect();
    let pixels: Vec<Lit> = valid
        .iter()
        // Odd, so that the points do not fall into a few columns.
        .step_by(valid.len().div_ceil(CALIBRATION_POINTS) | 1)
        .map(|&i| {
            let mut lit = [None; 2];
            for (axis, map) in decoded.axes() {
                lit[axis as usize] = Some(Measured {
                    px: map.coordinate[i].into(),
                    sigma: map.sigma[i].into(),
                })
                .filter(|m| !m.px.is_nan());
            }
            let [u, v] = [i % decoded.width, i / decoded.width].map(|at| at as f64);
            ([u, v], lit)
        })
        .collect();
    let sigma = triangulator.calibration_sigma(&pixels)?;
    finite_median(sigma.into_iter().map(|sigma| sigma as f32))
}

impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let percent = |n: usize| 100.0 * n as f64 / self.pixels as f64;
        writeln!(
            f,
            "frames       {} of {} x {}",
            self.frames, self.width, self.height
        )?;
        if let Some(m) = self.median_modulation_dn {
            writeln!(f, "modulation   {m:.2} DN (median)")?;
        }
        for axis in &self.axes {
            let sigma = axis.median_sigma_px.unwrap_or(f32::NAN);
            write!(
                f,
                "axis {}       {} valid ({:.1} %), sigma {sigma:.4} px",
                axis.axis,
                axis.valid,
                percent(axis.valid)
            )?;
            match axis.median_sampling_px {
                Some(px) if px > 0.0 => writeln!(f, ", held pixels {px:.4} px (medians)")?,
                _ => writeln!(f, " (median)")?,
            }
            for (name, count) in axis.masked.iter().filter(|(_, n)| *n > 0) {
                writeln!(f, "  {name:<16} {count:>9} ({:.2} %)", percent(*count))?;
            }
        }
        if let Some(points) = self.points {
            let sigma = self.median_depth_sigma_mm.unwrap_or(f32::NAN);
            writeln!(
                f,
                "points       {points}, sigma {sigma:.4} mm in depth (median)"
            )?;
        }
        if let Some(sigma) = self.median_calibration_sigma_mm {
            writeln!(
                f,
                "calibration  sigma {sigma:.4} mm in depth (median), common to neighbouring points"
            )?;
        }
        for note in &self.notes {
            writeln!(f, "note         {note}")?;
        }
        Ok(())
    }
}
