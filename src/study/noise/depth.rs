//! Trials of depth noise: one scene is scanned repeatedly, and the spread of each pixel is compared
//! with the decoder's standard deviation and with the bound propagated to depth.

use crate::scanned::Stage;
use crate::score::depth_bounds;
use phasmid_core::error::Result;
use phasmid_core::statistics::finite_median;
use phasmid_decode::{Decoded, Options};
use phasmid_measure::{GROSS_MM, Stated};
use phasmid_profile::{Profile, Scene};
use phasmid_render::{self as render, truth::Truth};
use phasmid_report::lab::Row;

/// Flags of a pixel that a scanner should measure.
const WANTED: u8 = Truth::SEEN | Truth::LIT | Truth::SQUARE;

/// A scene in front of a camera that has only the middle of the profile's sensor.
#[derive(Debug, Clone)]
pub(super) struct View {
    /// The profile.
    pub(super) profile: &'static str,
    /// The scene.
    pub(super) scene: &'static str,
    /// Exposure relative to the profile's.
    pub(super) light: f64,
    /// Columns and rows in the middle of the camera's image.
    pub(super) size_px: [u32; 2],
    /// Number of scans.
    pub(super) turns: u64,
}

/// Returns all views, or a selection that takes seconds.
pub(super) fn views(quick: bool) -> Vec<View> {
    let view = |profile, scene, light| View {
        profile,
        scene,
        light,
        size_px: if quick { [96, 64] } else { [192, 160] },
        turns: if quick { 8 } else { 24 },
    };
    if quick {
        return [1.0, 0.0625]
            .map(|light| view("pmp-bench", "trapezoid", light))
            .to_vec();
    }
    let mut views = Vec::new();
    for scene in ["trapezoid", "sphere"] {
        views.extend([1.0, 0.25, 0.0625].map(|light| view("pmp-bench", scene, light)));
    }
    views.push(view("pmp-real", "trapezoid", 1.0));
    views.push(view("webcam-grey", "sphere", 1.0));
    views
}

/// Depths and standard deviations of repeated scans.
struct Spread {
    scans: Vec<Decoded>,
}

/// Root mean squares over the pixels that have a depth in every scan, without creases.
#[derive(Debug, Default)]
struct Figures {
    pixels: f64,
    /// Three counts over all scans: points; points more than 1 mm off or without a surface; pixels
    /// at which a scanner should measure a point.
    points: f64,
    gross: f64,
    found: f64,
    /// Fraction of the points off by more than five of the decoder's standard deviations.
    beyond: f64,
    /// RMS deviation of the depths from the mean of their pixel.
    spread_mm: f64,
    /// RMS of the decoder's standard deviations.
    sigma_mm: f64,
    /// RMS of the bounds.
    bound_mm: f64,
    /// RMS of the ratio of spread to bound.
    ratio: f64,
    /// Mean square of the ratio of error to the decoder's standard deviation: 1 if the decoder is
    /// correct.
    chi_square: f64,
    /// RMS error of the pixels' means, after subtraction of the noise that remains in a mean.
    bias_mm: f64,
}

impl Spread {
    fn figures(&self, truth: &Truth, bounds: &[f64]) -> Figures {
        let mut f = Figures::default();
        let turns = self.scans.len() as f64;
        for (i, bound) in bounds.iter().enumerate() {
            if truth.flags[i] & Truth::CREASE != 0 {
                continue;
            }
            let depths = || self.scans.iter().map(|scan| f64::from(scan.depth[i]));
            let exact = f64::from(truth.depth_mm[i]);
            let off = |z: &f64| !((z - exact).abs() <= GROSS_MM);
            let points = depths().filter(|z| z.is_finite()).count() as f64;
            f.points += points;
            if truth.flags[i] & WANTED == WANTED {
                f.found += points;
            }
            let gross = depths().filter(|z| z.is_finite()).filter(off).count();
            f.gross += gross as f64;
            if gross > 0 || !depths().all(f64::is_finite) || !bound.is_finite() {
                continue;
            }
            let mean = depths().sum::<f64>() / turns;
            let variance = depths().map(|z| (z - mean).powi(2)).sum::<f64>() / (turns - 1.0);
            let sigmas = self.scans.iter().map(|scan| f64::from(scan.depth_sigma[i]));
            let own = sigmas.map(|s| s * s).sum::<f64>() / turns;
            let square = depths().map(|z| (z - exact).powi(2)).sum::<f64>() / turns;
            f.pixels += 1.0;
            f.spread_mm += variance;
            f.sigma_mm += own;
            f.bound_mm += bound * bound;
            f.ratio += variance / (bound * bound);
            f.chi_square += square / own;
            f.bias_mm += (mean - exact).powi(2) - variance / turns;
        }
        let rms = |sum: f64| (sum / f.pixels).max(0.0).sqrt();
        Figures {
            beyond: self.stated(truth).beyond_5_sigma,
            spread_mm: rms(f.spread_mm),
            sigma_mm: rms(f.sigma_mm),
            bound_mm: rms(f.bound_mm),
            ratio: rms(f.ratio),
            chi_square: f.chi_square / f.pixels,
            bias_mm: rms(f.bias_mm),
            ..f
        }
    }
}

impl Spread {
    /// Returns the errors of all points over the decoder's standard deviations, without creases.
    fn stated(&self, truth: &Truth) -> Stated {
        let smooth = (0..truth.flags.len()).filter(|&i| truth.flags[i] & Truth::CREASE == 0);
        Stated::of(smooth.flat_map(|i| {
            let points = self
                .scans
                .iter()
                .filter(move |scan| scan.depth[i].is_finite());
            points.map(move |scan| {
                let error = f64::from(scan.depth[i]) - f64::from(truth.depth_mm[i]);
                (error, scan.depth_sigma[i].into())
            })
        }))
    }
}

/// Scans a view repeatedly, and returns a row with spreads and bounds.
///
/// # Errors
/// Returns an error if a built-in profile or scene is invalid.
pub(super) fn measure(view: &View, seed: u64) -> Result<Row> {
    let mut profile = Profile::load(view.profile)?;
    let camera = &mut profile.camera;
    let [width, height] = view.size_px;
    camera.sensor_width_mm *= f64::from(width) / f64::from(camera.width_px);
    (camera.width_px, camera.height_px) = (width, height);
    camera.exposure_us *= view.light;
    let scene = Scene::load(view.scene)?;
    let mut stage = Stage::new(&profile, &scene, seed, render::Options::default())?;
    let truth = stage.truth();
    let (mut plain, mut weighted) = (Vec::new(), Vec::new());
    let weighing = Options {
        weighted: true,
        ..Options::default()
    };
    let (mut manifest, mut rig) = (None, None);
    for turn in 0..view.turns {
        let scanned = stage.scan(turn)?;
        plain.push(scanned.decode(Options::default())?.1);
        weighted.push(scanned.decode(weighing)?.1);
        (manifest, rig) = (Some(scanned.manifest), scanned.calibration);
    }
    let (Some(manifest), Some(rig)) = (manifest, rig) else {
        return Ok(Row::new());
    };
    let bounds = depth_bounds(&truth, &manifest, &rig);
    let f = Spread { scans: plain }.figures(&truth, &bounds);
    let w = Spread { scans: weighted }.figures(&truth, &bounds);
    let expected = truth
        .flags
        .iter()
        .filter(|&&flags| flags & (WANTED | Truth::CREASE) == WANTED)
        .count();
    let noise = rig
        .noise
        .unwrap_or_else(|| profile.camera.sensor.noise_model(0.0, 0.0));
    let smooth = || (0..truth.flags.len()).filter(|&i| bounds[i].is_finite());
    let b = finite_median(smooth().map(|i| f64::from(truth.modulation_dn[i]))).unwrap_or(f64::NAN);
    let mean = finite_median(smooth().map(|i| f64::from(truth.mean_dn[i]))).unwrap_or(f64::NAN);
    Ok(Row::new()
        .text("kind", "depth")
        .text("sensor", view.profile)
        .text("scene", view.scene)
        .number("light", view.light)
        .number("turns", view.turns as f64)
        .number("modulation_dn", b)
        .number("mean_dn", mean)
        .number("noise_dn", (noise.variance_dn2(mean) - 1.0 / 12.0).sqrt())
        .number("swing", super::bound::swing(&noise, mean, b))
        .number("samples", expected as f64 * view.turns as f64)
        .number("valid", f.points)
        .number("gross", f.gross)
        .number("beyond_5_sigma", f.beyond)
        .number("found", f.found)
        .number("pixels", f.pixels)
        .number("spread_mm", f.spread_mm)
        .number("sigma_mm", f.sigma_mm)
        .number("bound_mm", f.bound_mm)
        .number("ratio", f.ratio)
        .number("chi_square", f.chi_square)
        .number("bias_mm", f.bias_mm)
        .number("weighted_ratio", w.ratio)
        .number("weighted_chi_square", w.chi_square)
        .number("weighted_spread_mm", w.spread_mm)
        .number("weighted_gross", w.gross)
        .number("weighted_bias_mm", w.bias_mm))
}
