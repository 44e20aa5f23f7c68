//! Measures the interpolation of a moving scene's geometry: the key instants, the error of
//! projector coordinates, and the time per frame with and without interpolation.

use crate::cli::output::step;
use phasmid_render::{Interpolation, Renderer, Term, shot::Shot};
use serde::Serialize;
use std::fmt;
use std::time::Instant;

/// Device times at which interpolated geometry is compared with traced geometry, in nanoseconds: within
/// the first breath.
const TIMES_NS: [u64; 4] = [437_000_000, 1_263_000_000, 2_391_000_000, 3_517_000_000];

/// Interpolation at several instants, and times per frame.
#[derive(Debug, Serialize)]
pub(super) struct Motion {
    tolerance_px: f64,
    /// Device time in seconds, and the interpolation at that time; `None` if the geometry is
    /// traced.
    instants: Vec<(f64, Option<Interpolation>)>,
    /// Milliseconds per frame of the sequence.
    ms_per_frame: f64,
    /// Milliseconds per frame with traced geometry.
    traced_ms_per_frame: f64,
}

impl Motion {
    /// Compares and times a renderer's geometry; `None` for a still scene or a tolerance of 0.
    pub(super) fn measured(
        renderer: &mut Renderer,
        shots: &[Shot],
        tolerance_px: f64,
    ) -> Option<Self> {
        if tolerance_px == 0.0 || !renderer.plan().has(Term::Motion) {
            return None;
        }
        step("comparing interpolated with traced geometry");
        let images = shots.iter().filter_map(|s| s.pattern_image.as_deref());
        renderer.expect_pattern_images(images);
        let instants = TIMES_NS.map(|ns| (ns as f64 * 1e-9, renderer.interpolation(ns)));
        let mut ms_per_frame = |tolerance_px| {
            renderer.set_motion_tolerance(tolerance_px);
            let begin = Instant::now();
            for shot in shots {
                renderer.expose(shot);
            }
            begin.elapsed().as_secs_f64() * 1e3 / shots.len() as f64
        };
        let traced_ms_per_frame = ms_per_frame(0.0);
        Some(Self {
            tolerance_px,
            instants: instants.into(),
            ms_per_frame: ms_per_frame(tolerance_px),
            traced_ms_per_frame,
        })
    }
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "motion: {:.1} ms a frame, {:.1} ms if the geometry of every instant is traced; tolerance {} px",
            self.ms_per_frame, self.traced_ms_per_frame, self.tolerance_px
        )?;
        write!(
            f,
            "{:>7}{:>12}{:>10}{:>14}{:>14}{:>14}",
            "at", "keys every", "traced", "99.9 % within", "worst", "edges missed"
        )?;
        for (time_s, found) in &self.instants {
            match found {
                Some(found) => write!(
                    f,
                    "\n{:>5.2} s{:>9} ms{:>8.1} %{:>11.4} px{:>11.4} px{:>14}",
                    time_s,
                    found.spacing_ms,
                    100.0 * found.traced,
                    found.most_px,
                    found.worst_px,
                    found.missed
                )?,
                None => write!(f, "\n{time_s:>5.2} s{:>12}{:>10}", "-", "100 %")?,
            }
        }
        Ok(())
    }
}
