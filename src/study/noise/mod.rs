//! Study `noise`: the errors of phase and depth due to noise, compared with their theoretical bounds.
//!
//! Fringes of known phase are read by the sensors of profiles, with noise and rounding, and decoded as
//! in a scan. The errors are compared with the least-squares bound sqrt(2/N) sigma / B and the
//! Cramer-Rao bound (`bound`). Scenes are scanned repeatedly, and the spread of each pixel's depth is
//! compared with the decoder's own standard deviation and the bound (`depth`).

mod bound;
mod cases;
mod depth;
mod document;
mod phase;
mod stack;
mod tables;

use phasmid_core::error::Result;
use phasmid_report::lab::{Folder, Row, Rows, Section, Settings, Study, Trial};

/// The study.
pub struct Noise;

impl Study for Noise {
    fn name(&self) -> &'static str {
        "noise"
    }

    fn about(&self) -> &'static str {
        "Noise of phase and depth, compared with the bounds that the sensor's noise sets."
    }

    fn title(&self) -> &'static str {
        "Noise of phase and depth compared with its bounds"
    }

    fn columns(&self) -> &'static [&'static str] {
        &[
            "kind",
            "sensor",
            "gain_db",
            "scene",
            "light",
            "turns",
            "steps",
            "modulation_dn",
            "mean_dn",
            "nominal_dn",
            "noise_dn",
            "swing",
            "samples",
            "valid",
            "gross",
            "beyond_5_sigma",
            "found",
            "rms_px",
            "bound_px",
            "ratio",
            "rounded",
            "floor",
            "whitened",
            "weighted_valid",
            "weighted_gross",
            "weighted_ratio",
            "weighted_whitened",
            "pixels",
            "spread_mm",
            "sigma_mm",
            "bound_mm",
            "chi_square",
            "bias_mm",
            "weighted_spread_mm",
            "weighted_chi_square",
            "weighted_bias_mm",
            "plain_s",
            "weighted_s",
        ]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let grid = cases::Grid::new(settings.quick);
        let mut trials = Vec::new();
        let cases = cases::even(&grid)?.into_iter().chain(cases::shot(&grid)?);
        for (i, case) in cases.enumerate() {
            // Each trial has its own noise.
            let seed = settings.seed.wrapping_add(i as u64);
            trials.push(Trial::new(case.key.clone(), seed, move |context| {
                let row = Row::new()
                    .text("kind", case.kind)
                    .text("sensor", case.sensor)
                    .number("gain_db", case.gain_db)
                    .number("nominal_dn", case.noise_dn);
                Ok(vec![phase::measure(&case.fringe, context.seed, row)?])
            }));
        }
        for view in depth::views(settings.quick) {
            let key = format!("depth/{}/{}/light={}", view.profile, view.scene, view.light);
            trials.push(Trial::new(key, settings.seed, move |context| {
                Ok(vec![depth::measure(&view, context.seed)?])
            }));
        }
        trials.push(Trial::new("time", settings.seed, phase::time).alone());
        Ok(trials)
    }

    fn sections(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Vec<Section>> {
        Ok(document::of_rows(rows))
    }
}
