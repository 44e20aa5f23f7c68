//! The knobs that trade error for run time, and their application to a device.

use crate::clinic::binned;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, ManifestFrame, Pattern};
use phasmid_profile::{Object, Profile, Scene, Sequence};
use phasmid_render::gpu::adapters;
use phasmid_render::{Backend, Options};
use serde::Serialize;

/// Numbers of phase steps that are tried.
const STEPS: [u32; 7] = [3, 4, 6, 8, 12, 16, 24];
/// Numbers of camera pixels per side that are tried, relative to the profile's number.
const SCALES: [f64; 3] = [0.7, 0.5, 0.35];
/// Minimum side of a camera in pixels.
const SMALLEST_SIDE_PX: f64 = 48.0;

/// A position of every knob. The default is the device as its profile describes it.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct Setting {
    /// The sequence, if not the profile's first one.
    pub sequence: Option<String>,
    /// Phase steps of each set of fringes; as in the sequence if absent.
    pub steps: Option<u32>,
    /// Factor on the period of the fringes and on the cells of their Gray code.
    pub period: Option<f64>,
    /// Camera pixels on a side relative to the profile's: fewer, larger pixels that see the same field.
    pub scale: Option<f64>,
    /// Rays per pixel ([`Options::samples`]).
    pub samples: Option<u32>,
    /// Instants per exposure ([`Options::time_samples`]).
    pub time_samples: Option<u32>,
    /// Rays per point at which interreflection is computed.
    pub interreflection: Option<u32>,
    /// Whether the GPU renders.
    pub gpu: bool,
    /// Whether the decoder weights steps by their shot noise.
    pub weighted: bool,
}

impl std::fmt::Display for Setting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = [
            self.sequence.clone(),
            self.steps.map(|n| format!("{n} steps")),
            self.period.map(|by| format!("period x {by}")),
            self.scale.map(|by| format!("side x {by}")),
            self.samples.map(|n| format!("{n} rays a pixel")),
            self.time_samples.map(|n| format!("{n} instants")),
            self.interreflection
                .map(|n| format!("{n} rays of interreflection")),
            self.gpu.then(|| "GPU".to_owned()),
            self.weighted.then(|| "weighted".to_owned()),
        ];
        let words: Vec<String> = words.into_iter().flatten().collect();
        match words.is_empty() {
            true => f.write_str("as in the profile"),
            false => f.write_str(&words.join(", ")),
        }
    }
}

/// Returns the settings worth trying, the profile's own first: phase steps at each resolution, and each
/// other knob alone. Knobs that the device or the scene lacks are left out.
pub fn settings(profile: &Profile, scene: &Scene) -> Vec<Setting> {
    let usual = Setting::default;
    let mut all = vec![usual()];
    let own = profile.sequence.first().map_or(0, |s| steps_of(&s.frame));
    let steps = || {
        STEPS
            .into_iter()
            .filter(move |&n| n as usize != own)
            .map(Some)
    };
    let camera = &profile.camera;
    let side = f64::from(camera.width_px.min(camera.height_px));
    let scales = SCALES
        .into_iter()
        .filter(|by| side * by >= SMALLEST_SIDE_PX)
        .map(Some);
    for scale in std::iter::once(None).chain(scales) {
        let with = |steps| Setting {
            scale,
            steps,
            ..usual()
        };
        all.extend(
            std::iter::once(None)
                .chain(steps())
                .map(with)
                .filter(|s| *s != usual()),
        );
    }
    let others = profile
        .sequence
        .iter()
        .skip(1)
        .filter(|s| steps_of(&s.frame) > 0);
    all.extend(others.map(|s| Setting {
        sequence: Some(s.name.clone()),
        ..usual()
    }));
    let periods = [0.5, 2.0].map(|by| Setting {
        period: Some(by),
        ..usual()
    });
    all.extend(
        periods
            .into_iter()
            .filter(|s| s.apply(profile, scene).is_ok()),
    );
    all.extend([4, 16].map(|n| Setting {
        samples: Some(n),
        ..usual()
    }));
    if scene.object.iter().any(Object::moves) {
        all.extend([1, 2, 8].map(|n| Setting {
            time_samples: Some(n),
            ..usual()
        }));
    }
    if let Some(own) = &scene.interreflection {
        let others = [16, 64, 256]
            .map(Some)
            .into_iter()
            .filter(|n| *n != own.samples);
        all.extend(others.map(|interreflection| Setting {
            interreflection,
            ..usual()
        }));
    }
    if adapters().iter().any(|adapter| adapter.hardware) {
        all.push(Setting {
            gpu: true,
            ..usual()
        });
    }
    all.push(Setting {
        weighted: true,
        ..usual()
    });
    all
}

impl Setting {
    /// Returns the device and the scene with this setting, and the options of the renderer.
    ///
    /// # Errors
    /// Returns an error if the device lacks the sequence, or if its period cannot be changed.
    pub fn apply(&self, profile: &Profile, scene: &Scene) -> Result<(Profile, Scene, Options)> {
        let (mut profile, mut scene) = (profile.clone(), scene.clone());
        let wanted = |s: &Sequence| self.sequence.as_ref().is_none_or(|name| s.name == *name);
        let names = || {
            profile
                .sequence
                .iter()
                .map(|s| s.name.as_str())
                .collect::<Vec<_>>()
        };
        let mut sequence = profile
            .sequence
            .iter()
            .find(|s| wanted(s))
            .cloned()
            .ok_or_else(|| {
                let found = self.sequence.as_deref().unwrap_or("no sequence");
                Error::input("sequence", found, names().join(", "))
            })?;
        if let Some(by) = self.period {
            sequence.frame = with_period(&sequence.frame, by)?;
        }
        if let Some(steps) = self.steps {
            sequence.frame = with_steps(&sequence.frame, steps);
        }
        profile.sequence = vec![sequence];
        if let Some(by) = self.scale {
            let side = |px: u32| (f64::from(px) * by).round().max(1.0) as u32;
            let size = [profile.camera.width_px, profile.camera.height_px].map(side);
            binned(&mut profile, size);
        }
        if let (Some(samples), Some(indirect)) = (self.interreflection, &mut scene.interreflection)
        {
            indirect.samples = Some(samples);
        }
        let usual = Options::default();
        let options = Options {
            samples: self.samples.unwrap_or(usual.samples),
            time_samples: self.time_samples.unwrap_or(usual.time_samples),
            backend: if self.gpu { Backend::Gpu } else { Backend::Cpu },
            ..usual
        };
        Ok((profile, scene, options))
    }
}

/// Returns the number of steps of the first set of fringes; 0 without fringes.
fn steps_of(frames: &[ManifestFrame]) -> usize {
    let mut keys = frames.iter().filter_map(key);
    let first = keys.next();
    usize::from(first.is_some()) + keys.filter(|key| Some(*key) == first).count()
}

/// Returns the key of the fringe set to which a frame belongs.
fn key(frame: &ManifestFrame) -> Option<(Axis, u64)> {
    match frame.pattern {
        Pattern::Fringe {
            axis, period_px, ..
        } => Some((axis, period_px.to_bits())),
        _ => None,
    }
}

/// Replaces each set of fringes by one with `steps` steps, at the position of its first frame.
fn with_steps(frames: &[ManifestFrame], steps: u32) -> Vec<ManifestFrame> {
    let mut seen = Vec::new();
    let mut out = Vec::new();
    for frame in frames {
        match (key(frame), &frame.pattern) {
            (Some(key), _) if seen.contains(&key) => {}
            (
                Some(key),
                &Pattern::Fringe {
                    axis,
                    period_px,
                    phase_rad,
                },
            ) => {
                seen.push(key);
                out.extend(shown(Pattern::fringe_set(
                    axis, period_px, steps, phase_rad,
                )));
            }
            _ => out.push(frame.clone()),
        }
    }
    out
}

/// Scales fringes and Gray cells by `by`; this may add or remove a bit of the code.
fn with_period(frames: &[ManifestFrame], by: f64) -> Result<Vec<ManifestFrame>> {
    let mut out = Vec::new();
    for axis in [Axis::X, Axis::Y] {
        let of: Vec<&Pattern> = frames
            .iter()
            .map(|f| &f.pattern)
            .filter(|p| p.axis() == Some(axis))
            .collect();
        if of.is_empty() {
            continue;
        }
        let mut fringes = of.iter().filter_map(|pattern| match **pattern {
            Pattern::Fringe {
                period_px,
                phase_rad,
                ..
            } => Some((period_px, phase_rad)),
            _ => None,
        });
        let (period_px, phase_rad) = fringes.next().ok_or_else(|| unfit("no fringes"))?;
        if fringes.clone().any(|(other, _)| other != period_px) {
            return Err(unfit("fringes of several periods"));
        }
        let steps = 1 + fringes.count() as u32;
        let grays: Vec<_> = of
            .iter()
            .filter_map(|pattern| match **pattern {
                Pattern::Gray {
                    cell_px,
                    bits,
                    inverted,
                    ..
                } => Some((cell_px, bits, inverted)),
                _ => None,
            })
            .collect();
        let whole = grays.iter().find(|(cell_px, ..)| *cell_px == period_px);
        let &(cell_px, bits, _) = whole.ok_or_else(|| unfit("no Gray code of whole periods"))?;
        let half = grays.iter().any(|(cell, ..)| *cell == cell_px / 2.0);
        let pairs = grays.iter().any(|(.., inverted)| *inverted);
        let bits = f64::from(bits) - by.log2();
        if bits < 1.0 || period_px * by <= 4.0 {
            return Err(unfit("a period beyond the range of the Gray code"));
        }
        out.extend(shown(Pattern::fringe_set(
            axis,
            period_px * by,
            steps,
            phase_rad,
        )));
        out.extend(shown(Pattern::gray_set(
            axis,
            cell_px * by,
            bits.ceil() as u32,
            half,
            pairs,
        )));
    }
    let rest = frames.iter().filter(|frame| frame.pattern.axis().is_none());
    out.extend(rest.cloned());
    Ok(out)
}

fn unfit(found: &str) -> Error {
    let expected = "fringes of one period with a Gray code of whole periods along each axis";
    Error::input("sequence", found, expected)
}

fn shown(patterns: Vec<Pattern>) -> impl Iterator<Item = ManifestFrame> {
    patterns.into_iter().map(|pattern| ManifestFrame {
        file: None,
        pattern,
    })
}
