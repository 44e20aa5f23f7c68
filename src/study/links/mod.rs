//! Speed of the links that carry commands to a device and its frames to the host: latency from a
//! trigger to the complete frame, and frames per second ([`measure`]).
//!
//! The device uses the fast clock, so exposures take no time; only rendering and the link take time. In
//! memory there is no link: the device renders a frame on the host's own thread when the host asks for
//! it. Over a link, the device renders the next frames of a sequence while the host receives the
//! previous one, so a link can be faster than the device in memory.

mod link;
mod talk;

use link::LINKS;
use phasmid_core::error::{Error, Result};
use phasmid_profile::{Profile, Scene};
use phasmid_report::spread::{Spread, quantile};
use phasmid_report::stopwatch::Stopwatch;
use serde::Serialize;
use talk::Missing;

/// Exposure of a frame and period of a pattern in microseconds. Exposures are short because a V4L2 node
/// receives frames no faster than they are exposed.
const SHORT_US: [f64; 2] = [100.0, 200.0];
/// Number of rounds over all links.
const ROUNDS: usize = 3;

/// The speed of each link with one device.
#[derive(Debug, Clone, Serialize)]
pub struct LinkSpeeds {
    /// Number of bytes of a frame, with its embedded data line.
    pub frame_bytes: usize,
    /// Time of a memory copy of these bytes, in microseconds.
    pub copy_us: f64,
    /// One entry per link.
    pub links: Vec<LinkSpeed>,
}

/// The speed of one link.
#[derive(Debug, Clone, Serialize)]
pub struct LinkSpeed {
    /// Name of the link.
    pub link: &'static str,
    /// The reason why the machine cannot use this link; `None` if it was measured.
    pub lacks: Option<String>,
    /// The measured speed.
    pub figures: Option<LinkFigures>,
}

/// Measured speed of a link.
#[derive(Debug, Clone, Serialize)]
pub struct LinkFigures {
    /// Number of frames triggered one by one.
    pub triggers: usize,
    /// Time from the trigger's command to the complete frame at the host in microseconds: shortest,
    /// median, 99th percentile and longest.
    pub latency_us: [f64; 4],
    /// Number of frames in whole sequences.
    pub frames: usize,
    /// Number of frames that did not arrive. Only a V4L2 node loses frames, because it overwrites frames
    /// that its reader does not take in time.
    pub lost: usize,
    /// Frames per second of a sequence, from the trigger's command to the last frame: lower quartile,
    /// median, upper quartile.
    pub frames_per_s: [f64; 3],
}

/// Measures every link that the machine has, with the built-in device `pmp-bench`: up to `frames` frames
/// per link in each of three rounds, but at least one sequence, first triggered one by one and then in
/// whole sequences. A machine's speed varies over time, so the links take turns.
///
/// The sensor is noiseless and a plane stands before the device, so that a frame takes little time to
/// render.
///
/// # Errors
/// Returns an error that names the link if a link fails that the machine has.
pub fn measure(frames: usize, watch: Stopwatch<'_>) -> Result<LinkSpeeds> {
    let profile = device()?;
    let scene = Scene::load("plane")?;
    let patterns = profile.sequence[0].frame.len();
    let turns = (frames / patterns).max(1);
    let mut found: [Result<Measured, String>; LINKS.len()] =
        std::array::from_fn(|_| Ok(Measured::default()));
    for _ in 0..ROUNDS {
        for (link, found) in LINKS.into_iter().zip(&mut found) {
            let Ok(measured) = found else { continue };
            let done = talk::over((&profile, &scene), link, |talk| {
                talk.prepare_triggers(patterns)?;
                for _ in 0..turns {
                    measured.latencies.extend(talk.triggered(watch, patterns)?);
                }
                talk.prepare_sequences(patterns)?;
                for _ in 0..turns {
                    let (came, seconds) = talk.sequence(watch, patterns, link.overwrites())?;
                    measured.frames += patterns;
                    measured.lost += patterns - came;
                    measured.rates.push(came as f64 / seconds);
                }
                Ok(())
            });
            match done {
                Ok(()) => {}
                Err(Missing::Lack(why)) => *found = Err(why),
                Err(Missing::Broken(e)) => {
                    return Err(Error::device(format!("{}: {e}", link.name())));
                }
            }
        }
    }
    let camera = &profile.camera;
    let frame_bytes = camera.width_px as usize * (camera.height_px as usize + 1);
    let links = LINKS.into_iter().zip(found).map(|(link, found)| LinkSpeed {
        link: link.name(),
        lacks: found.as_ref().err().cloned(),
        figures: found.ok().map(Measured::figures),
    });
    Ok(LinkSpeeds {
        frame_bytes,
        copy_us: watch.seconds_a_copy(frame_bytes) * 1e6,
        links: links.collect(),
    })
}

/// Measurements of one link; times in seconds.
#[derive(Default)]
struct Measured {
    latencies: Vec<f64>,
    frames: usize,
    lost: usize,
    rates: Vec<f64>,
}

impl Measured {
    fn figures(mut self) -> LinkFigures {
        self.latencies.sort_by(f64::total_cmp);
        let rate = Spread::new(self.rates);
        LinkFigures {
            triggers: self.latencies.len(),
            latency_us: [0.0, 0.5, 0.99, 1.0].map(|share| quantile(&self.latencies, share) * 1e6),
            frames: self.frames,
            lost: self.lost,
            frames_per_s: [rate.low, rate.median, rate.high],
        }
    }
}

/// Returns `pmp-bench` with the embedded data line, which identifies frames on every link, with short
/// exposures of unchanged total light, and without noise.
fn device() -> Result<Profile> {
    let mut profile = Profile::load("pmp-bench")?;
    profile.camera.data_line = true;
    profile.camera.sensor.noiseless = true;
    let [exposure_us, period_us] = SHORT_US;
    profile.projector.radiant_intensity_w_sr *= profile.camera.exposure_us / exposure_us;
    profile.camera.exposure_us = exposure_us;
    profile.sequence[0].period_us = period_us;
    Ok(profile)
}
