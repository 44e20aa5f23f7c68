//! The measured cases: numbers of steps, modulations and noises of fringes, and scenes.

use super::phase::even_sensor;
use super::stack::Fringe;
use phasmid_core::error::Result;
use phasmid_profile::{Profile, Sensor};

/// A fringe with its key and its noise.
#[derive(Debug, Clone)]
pub(super) struct Case {
    /// Key of the trial.
    pub(super) key: String,
    /// Table of the case: `even` or `shot`.
    pub(super) kind: &'static str,
    /// Profile that the sensor is taken from; empty if it is not from a profile.
    pub(super) sensor: &'static str,
    /// Gain above the profile's, in decibels.
    pub(super) gain_db: f64,
    /// Standard deviation of the samples before rounding, in digital numbers, for noise that is equal
    /// at all levels.
    pub(super) noise_dn: f64,
    /// The fringe.
    pub(super) fringe: Fringe,
}

/// Standard deviations of the noise in the first table, in digital numbers.
pub(super) const NOISES_DN: [f64; 7] = [0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0];
/// Modulations in digital numbers.
pub(super) const MODULATIONS_DN: [f64; 6] = [2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
/// Numbers of phase steps.
pub(super) const STEPS: [usize; 11] = [3, 4, 5, 6, 7, 8, 10, 12, 16, 24, 32];
/// Sensors of the second table, and their gains above the profile's.
pub(super) const SENSORS: [(&str, f64); 5] = [
    ("pmp-bench", 0.0),
    ("pmp-bench", 12.0),
    ("pmp-bench", 24.0),
    ("webcam-grey", 0.0),
    ("webcam-grey", 18.0),
];
/// Ratio of the modulation to the mean above black in the second table: the scene has no ambient light,
/// but camera and projector pixels average the fringes.
const CONTRAST: f64 = 0.95;

/// The grid of cases: complete, or a part of it that takes seconds.
pub(super) struct Grid {
    pub(super) steps: Vec<usize>,
    pub(super) modulations_dn: Vec<f64>,
    pub(super) noises_dn: Vec<f64>,
    pub(super) sensors: Vec<(&'static str, f64)>,
    pub(super) rows: usize,
}

impl Grid {
    pub(super) fn new(quick: bool) -> Self {
        if quick {
            return Self {
                steps: vec![3, 4, 5, 8, 12, 32],
                modulations_dn: vec![2.0, 10.0, 50.0],
                noises_dn: vec![0.1, 0.5, 2.0],
                sensors: vec![SENSORS[0], SENSORS[2]],
                rows: 48,
            };
        }
        Self {
            steps: STEPS.to_vec(),
            modulations_dn: MODULATIONS_DN.to_vec(),
            noises_dn: NOISES_DN.to_vec(),
            sensors: SENSORS.to_vec(),
            rows: 160,
        }
    }
}

/// Returns fringes with the same noise at every step, around the middle of an 8-bit range.
///
/// # Errors
/// Returns an error if a built-in profile cannot be read.
pub(super) fn even(grid: &Grid) -> Result<Vec<Case>> {
    let like = Profile::load("pmp-bench")?.camera.sensor;
    let mut cases = Vec::new();
    for &steps in &grid.steps {
        for &noise_dn in &grid.noises_dn {
            for &modulation_dn in &grid.modulations_dn {
                cases.push(Case {
                    key: format!("even/N={steps}/noise={noise_dn}/B={modulation_dn}"),
                    kind: "even",
                    sensor: "",
                    gain_db: 0.0,
                    noise_dn,
                    fringe: Fringe {
                        steps,
                        modulation_dn,
                        mean_dn: 128.0,
                        sensor: even_sensor(&like, noise_dn),
                        rows: grid.rows,
                    },
                });
            }
        }
    }
    Ok(cases)
}

/// Returns fringes without other light, as read by sensors of profiles.
///
/// # Errors
/// Returns an error if a built-in profile cannot be read.
pub(super) fn shot(grid: &Grid) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for &(name, gain_db) in &grid.sensors {
        let own = Profile::load(name)?.camera.sensor;
        let sensor = Sensor {
            gain_dn_per_e: own.gain_at(gain_db),
            ..own
        };
        for &steps in &grid.steps {
            for &modulation_dn in &grid.modulations_dn {
                cases.push(Case {
                    key: format!("shot/{name}/{gain_db}dB/N={steps}/B={modulation_dn}"),
                    kind: "shot",
                    sensor: name,
                    gain_db,
                    noise_dn: f64::NAN,
                    fringe: Fringe {
                        steps,
                        modulation_dn,
                        mean_dn: sensor.black_level_dn + modulation_dn / CONTRAST,
                        sensor: sensor.clone(),
                        rows: grid.rows,
                    },
                });
            }
        }
    }
    Ok(cases)
}
