//! Measures error and time of a setting, and chooses among settings.

use super::Setting;
use crate::scanned::Stage;
use crate::score::score;
use phasmid_core::error::Result;
use phasmid_decode::{Decoded, Options};
use phasmid_profile::{Profile, Scene};
use phasmid_report::stopwatch::Stopwatch;
use serde::Serialize;
use std::hint::black_box;

/// Maximum rate of gross errors of a sound setting.
pub const MOST_GROSS: f64 = 0.01;
/// Minimum coverage of a sound setting.
pub const LEAST_COVERAGE: f64 = 0.9;

/// Error and time of a setting.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// The setting.
    pub setting: Setting,
    /// Columns and rows of the camera.
    pub size_px: [u32; 2],
    /// Frames of a scan.
    pub frames: usize,
    /// Time to render a scan with its geometry, in milliseconds.
    pub render_ms: f64,
    /// Time to decode a scan, in milliseconds.
    pub decode_ms: f64,
    /// Root mean square depth error of the inliers on smooth surfaces, in millimetres.
    pub rmse_mm: f64,
    /// Noise bound of this error, in millimetres.
    pub bound_mm: f64,
    /// Share of points that are more than 1 mm off.
    pub gross_error_rate: f64,
    /// Share of the lit and visible pixels that have a point.
    pub coverage: f64,
}

impl Measured {
    /// Time to render and decode a scan, in milliseconds.
    pub fn total_ms(&self) -> f64 {
        self.render_ms + self.decode_ms
    }

    /// Returns whether the setting may be chosen: it covers the surface with few gross errors.
    pub fn is_sound(&self) -> bool {
        self.coverage >= LEAST_COVERAGE
            && self.gross_error_rate <= MOST_GROSS
            && self.rmse_mm.is_finite()
    }
}

/// Scans a scene with a setting, calibrated with the true rig, and compares it with the truth. Times are
/// the fastest of up to `rounds` rounds that begin within `enough_s` seconds.
///
/// # Errors
/// Returns an error if the setting does not fit the device, or if the scan cannot be decoded.
pub fn measure(
    (profile, scene): (&Profile, &Scene),
    setting: &Setting,
    seed: u64,
    watch: Stopwatch<'_>,
    (rounds, enough_s): (usize, f64),
) -> Result<Measured> {
    let (profile, scene, options) = setting.apply(profile, scene)?;
    let mut stage = Stage::new(&profile, &scene, seed, options)?;
    // The first scan also computes the tables of the patterns, which a device does only once.
    let scanned = stage.scan(0)?;
    let render_s = watch.fastest(rounds, enough_s, || {
        stage.renderer().invalidate();
        let _ = black_box(stage.scan(0));
    });
    let decoder = scanned.decoder(Options {
        weighted: setting.weighted,
        ..Options::default()
    })?;
    let decoded = decoder.decode(&scanned.images)?;
    let mut again = Decoded::default();
    let decode_s = watch.fastest(rounds, enough_s, || {
        let _ = black_box(decoder.decode_into(&scanned.images, &mut again));
    });
    let rig = profile.nominal_rig();
    let score = score(&decoded, &stage.truth(), &scanned.manifest, &rig)?;
    Ok(Measured {
        setting: setting.clone(),
        size_px: [profile.camera.width_px, profile.camera.height_px],
        frames: scanned.images.len(),
        render_ms: render_s * 1e3,
        decode_ms: decode_s * 1e3,
        rmse_mm: score.inlier_rmse_mm,
        bound_mm: score.bound_mm,
        gross_error_rate: score.gross_error_rate,
        coverage: score.coverage,
    })
}

/// Returns for each setting whether it is on the Pareto front: it is sound, and no other sound setting
/// is both faster and more accurate.
pub fn front(all: &[Measured]) -> Vec<bool> {
    let beats = |a: &Measured, b: &Measured| {
        let [faster, better] = [a.total_ms() - b.total_ms(), a.rmse_mm - b.rmse_mm];
        a.is_sound() && faster <= 0.0 && better <= 0.0 && (faster < 0.0 || better < 0.0)
    };
    let on = |one: &Measured| one.is_sound() && !all.iter().any(|other| beats(other, one));
    all.iter().map(on).collect()
}

/// Returns the fastest sound setting with an RMS error of at most `wanted_mm`.
pub fn cheapest(all: &[Measured], wanted_mm: f64) -> Option<&Measured> {
    let fits = |m: &&Measured| m.is_sound() && m.rmse_mm <= wanted_mm;
    let time = |a: &&Measured, b: &&Measured| a.total_ms().total_cmp(&b.total_ms());
    all.iter().filter(fits).min_by(time)
}
