//! Ground truth of frames.

use super::time::{Light, middle_ns};
use super::{Renderer, exposure};
use crate::Term;
use crate::world::Surface;
use crate::{shot::Shot, truth, truth::Truth};
use phasmid_pattern::{Axis, Pattern, finest_fringe};

impl Renderer {
    /// Returns the ground truth of a sequence's frames: geometry, and mean and modulation of its
    /// finest fringes before noise and rounding. For a moving scene it is evaluated midway between
    /// the start of the first exposure and the end of the last.
    pub fn truth(&mut self, sequence: &[(Pattern, Shot)]) -> Truth {
        let middle = middle_ns(sequence.iter().map(|(_, shot)| shot));
        self.truth_at(sequence, middle)
    }

    /// Same as [`Self::truth`] at a device time in nanoseconds, with the scene frozen in its state
    /// at that time.
    pub fn truth_at(&mut self, sequence: &[(Pattern, Shot)], time_ns: u64) -> Truth {
        self.expect_pattern_images(
            sequence
                .iter()
                .filter_map(|(_, s)| s.pattern_image.as_deref()),
        );
        self.go_to_time(time_ns);
        self.prepare();
        let fringes = finest_fringes(sequence);
        let signals: Vec<_> = fringes
            .iter()
            .map(|(_, shot)| {
                let light = Light::Scheduled(self.schedule(shot));
                self.expected(shot, light)
            })
            .collect();
        let phases: Vec<_> = fringes.iter().map(|(phase, _)| *phase).collect();
        let mut flags = self.flags(sequence);
        for ((_, shot), signal) in fringes.iter().zip(&signals) {
            let exposure_s = shot.exposure_ns as f64 * 1e-9;
            let sensor = &self.profile.camera.sensor;
            let full = sensor.noise_model(shot.gain_db, exposure_s).saturation_dn;
            truth::flag_saturated(&mut flags, signal, full);
        }
        let map = &self.buffer;
        let (mean_dn, modulation_dn) = truth::harmonic(&phases, &signals, map.x.len());
        Truth {
            width: map.width as u32,
            height: map.height as u32,
            depth_mm: map.depth.clone(),
            projector_x: map.x.clone(),
            projector_y: map.y.clone(),
            flags,
            mean_dn,
            modulation_dn,
        }
    }

    /// Returns the map's flags, with pixels added where the sequence's finest fringes are
    /// unresolved.
    fn flags(&self, sequence: &[(Pattern, Shot)]) -> Vec<u8> {
        let map = &self.buffer;
        let mut flags = map.flags.clone();
        if self.plan.has(Term::Motion) {
            for (flags, &surface) in flags.iter_mut().zip(&map.surface) {
                if *flags & Truth::SEEN != 0 && self.worlds.any().moving(Surface(surface)) {
                    *flags |= Truth::MOVING;
                }
            }
        }
        let Some((axis, period)) = finest_fringe(sequence.iter().map(|(pattern, _)| pattern))
        else {
            return flags;
        };
        let slope = match axis {
            Axis::X => &map.x_slope,
            Axis::Y => &map.y_slope,
        };
        let lit = |flags: u8| flags & Truth::LIT != 0;
        for (i, flags) in flags.iter_mut().enumerate().filter(|(_, f)| lit(**f)) {
            let blur = map.blur_along(map.blur.get(i).copied().unwrap_or(0.0))[axis as usize];
            let skin = map.skin.as_ref();
            let under = skin.map_or(1.0, |skin| skin.contrast(i, axis as usize, period));
            let resolved = slope
                .get(i)
                .is_none_or(|slope| exposure::is_resolved(*slope, blur, under, period));
            if !resolved {
                *flags |= Truth::UNRESOLVED;
            }
        }
        flags
    }
}

/// Returns the phases and shots of the finest fringes.
fn finest_fringes(sequence: &[(Pattern, Shot)]) -> Vec<(f64, &Shot)> {
    let finest = finest_fringe(sequence.iter().map(|(pattern, _)| pattern));
    sequence
        .iter()
        .filter_map(|(pattern, shot)| match *pattern {
            Pattern::Fringe {
                axis,
                period_px,
                phase_rad,
            } if finest == Some((axis, period_px)) => Some((phase_rad, shot)),
            _ => None,
        })
        .collect()
}
