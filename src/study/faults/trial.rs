//! One scan of a device with a fault, and its outcome.

use crate::desk::{Desk, Link};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, Decoded, Options, check_modulation};
use phasmid_device::Device;
use phasmid_host::{Camera, CommandPort, Intake, Progress, ScanOptions, Scanner};
use phasmid_measure::GROSS_MM;
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::faults::{Direction, Fault, Schedule, Side, Struck, What};
use phasmid_render::{Renderer, truth::Truth};
use std::time::Duration;

/// Timeout of the host for a reply, in virtual time.
const REPLY_TIMEOUT: Duration = Duration::from_secs(2);
/// Timeout of the host for a frame, in virtual time.
const FRAME_TIMEOUT: Duration = Duration::from_millis(400);
/// Number of consecutive fault-free scans of a device: a repeated run has the random numbers of a later
/// scan.
const SOUND: usize = 4;
/// Maximum fraction of the fault-free points that a harmless fault removes.
const LOST: f64 = 0.01;
/// Maximum fraction of the points that a harmless fault moves by more than [`SIGMAS`].
const MOVED: f64 = 1e-3;
/// Number of stated standard deviations beyond which a point counts as moved.
const SIGMAS: f32 = 5.0;

/// The outcome of a scan.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The fault-free cloud, or after a repeated run a cloud with a harmless difference.
    Recovered,
    /// An error that says what is wrong.
    Reported(String),
    /// A cloud of damaged frames that hardly differs from the fault-free cloud.
    Harmless(Difference),
    /// Another cloud, and no error.
    Wrong(Difference),
}

/// Difference between a cloud and the fault-free cloud with the same random numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Difference {
    /// Fraction of the fault-free points that are missing.
    pub lost: f64,
    /// Fraction of the points that are more than five stated standard deviations from the fault-free
    /// ones, or, where the fault-free scan has no point, more than 1 mm off the truth.
    pub moved: f64,
}

impl Difference {
    fn is_harmless(self) -> bool {
        self.lost <= LOST && self.moved <= MOVED
    }

    /// Returns, for each of the two fractions, the larger value of both differences.
    pub(super) fn worst(self, other: Self) -> Self {
        Self {
            lost: self.lost.max(other.lost),
            moved: self.moved.max(other.moved),
        }
    }
}

/// A device and the way in which the host reaches it.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Name in a table.
    pub name: String,
    /// The device.
    pub profile: Profile,
    /// Scene in front of the device.
    pub scene: Scene,
    /// How frames reach the host.
    pub link: Link,
    /// Dialect of the control port, by its built-in name; SCPI if absent.
    pub dialect: Option<&'static str>,
}

/// A device in front of a scene, with its fault-free scans for comparison.
pub struct Trial {
    setting: Setting,
    /// Number of frames, messages to the device and messages from the device in a sound scan.
    counts: [u64; 3],
    renderer: Option<Renderer>,
    truth: Truth,
    /// Consecutive fault-free scans.
    sound: Vec<Decoded>,
}

/// Result of one scan with a fault.
pub struct Tried {
    /// Difference from the fault-free cloud, or the host's error.
    pub cloud: Result<Difference>,
    /// Reasons why runs were discarded and repeated.
    pub retries: Vec<String>,
    /// The faults that struck.
    pub struck: Vec<Struck>,
}

impl Trial {
    /// Creates a trial from a setting.
    ///
    /// # Errors
    /// Returns an error if profile or scene cannot be rendered, or if the device cannot be scanned
    /// without faults.
    pub fn new(setting: &Setting) -> Result<Self> {
        let mut setting = setting.clone();
        // Points are compared with the truth, so use the exact calibration.
        setting.profile.factory_calibration.exact = true;
        let profile = &setting.profile;
        let mut device = Device::builder(profile, &setting.scene).seed(1).build()?;
        let shots = device.shots();
        let truth = device.renderer.truth(&shots);
        let mut trial = Self {
            setting,
            counts: [0; 3],
            renderer: Some(device.renderer),
            truth,
            sound: Vec::new(),
        };
        let mut scans = Vec::new();
        trial
            .with_desk(&Schedule::default(), |trial, desk| {
                let mut scanner = trial.scanner(desk)?;
                for _ in 0..SOUND {
                    let captured = scanner.scan(&trial.options(), &mut |_| {})?;
                    scans.push(decoded(&captured)?);
                }
                scanner.finish()
            })?
            .0?;
        trial.sound = scans;
        trial.count()?;
        Ok(trial)
    }

    /// Counts frames and messages of a sound scan, with faults that strike everything and change
    /// nothing.
    fn count(&mut self) -> Result<()> {
        let harmless = [
            What::Late { by_ms: 0.0 },
            What::BitErrors {
                direction: Direction::ToDevice,
                count: None,
                rate: Some(0.0),
            },
            What::LateReply { by_ms: 0.0 },
        ];
        let struck = self.scan(&Schedule {
            seed: 0,
            fault: harmless.map(Fault::new).to_vec(),
        })?;
        struck.cloud?;
        self.counts = harmless.map(|what| {
            let of_kind = struck.struck.iter().filter(|s| s.what == what.name());
            of_kind.count() as u64
        });
        Ok(())
    }

    /// Returns the number of frames, messages to the device and messages from the device in a sound
    /// scan.
    pub fn counts(&self) -> [u64; 3] {
        self.counts
    }

    /// Returns the number of frames or messages of a sound scan that a fault could strike.
    pub fn events(&self, fault: &Fault) -> u64 {
        let [frames, asked, answered] = self.counts;
        match (fault.side(), fault.what) {
            (Side::Camera, _) => frames,
            (_, What::Nak | What::Disconnect { .. } | What::Reset) => asked,
            (
                _,
                What::BitErrors {
                    direction: Direction::ToDevice,
                    ..
                },
            ) => asked,
            _ => answered,
        }
    }

    /// Calls a function with a device; returns its result and the faults that struck.
    fn with_desk<T>(
        &mut self,
        schedule: &Schedule,
        then: impl FnOnce(&Self, &Desk) -> T,
    ) -> Result<(T, Vec<Struck>)> {
        let Some(renderer) = self.renderer.take() else {
            return Err(Error::device("the last device was not given back"));
        };
        let setting = &self.setting;
        let mut builder = Device::builder(&setting.profile, &setting.scene)
            .renderer(renderer)
            .faults(schedule);
        if let Some(name) = setting.dialect {
            builder = builder.dialect(Dialect::load(name)?);
        }
        let desk = Desk::new(builder.build()?, setting.link);
        let done = then(self, &desk);
        let Some(device) = desk.into_device() else {
            return Err(Error::device("the host has not let go of the device"));
        };
        let struck = device.machine.faults().struck().cloned().collect();
        self.renderer = Some(device.renderer);
        Ok((done, struck))
    }

    /// Scans with a schedule of faults.
    ///
    /// # Errors
    /// Returns an error if the device cannot be created. Errors of the host are part of the result.
    pub fn scan(&mut self, schedule: &Schedule) -> Result<Tried> {
        let mut retries = Vec::new();
        let (cloud, struck) = self.with_desk(schedule, |trial, desk| {
            let mut scanner = trial.scanner(desk)?;
            let captured = scanner.scan(&trial.options(), &mut |progress| {
                if let Progress::Retry(why) = progress {
                    retries.push(why.to_owned());
                }
            });
            let finished = scanner.finish();
            let captured = captured?;
            finished?;
            Ok(trial.difference(&decoded(&captured)?, !retries.is_empty()))
        })?;
        Ok(Tried {
            cloud,
            retries,
            struck,
        })
    }

    /// Classifies a scan by its outcome.
    pub fn judge(&self, tried: &Tried) -> Outcome {
        match &tried.cloud {
            Err(error) => Outcome::Reported(error.to_string()),
            Ok(difference) if *difference == Difference::default() => Outcome::Recovered,
            Ok(difference) if !difference.is_harmless() => Outcome::Wrong(*difference),
            Ok(_) if !tried.retries.is_empty() => Outcome::Recovered,
            Ok(difference) => Outcome::Harmless(*difference),
        }
    }

    fn options(&self) -> ScanOptions {
        ScanOptions {
            sequence: Some(self.setting.profile.sequence[0].name.clone()),
            manifest: None,
            frame_timeout: FRAME_TIMEOUT,
        }
    }

    fn scanner(&self, desk: &Desk) -> Result<Scanner<impl Camera, impl CommandPort>> {
        let open = || Ok(Intake::new(desk.camera()));
        let dialect = self.setting.dialect.map(Dialect::load).transpose()?;
        Scanner::with_dialect(desk.port(), dialect, REPLY_TIMEOUT, open)
    }

    /// Returns whether a measured depth is more than 1 mm off, or lies at a pixel that sees no surface.
    fn is_gross(&self, pixel: usize, measured: f32) -> bool {
        // The truth is NaN at pixels that see no surface; the comparison is then false.
        let small = f64::from(measured - self.truth.depth_mm[pixel]).abs() <= GROSS_MM;
        measured.is_finite() && !small
    }

    /// Compares a scan with the most similar fault-free scan: the one with the same random numbers, if
    /// it exists. A `repeated` run may have other random numbers, so the standard deviations of both
    /// scans are combined.
    fn difference(&self, scan: &Decoded, repeated: bool) -> Difference {
        let compare = |sound| self.compared(scan, sound, repeated);
        let differences = self.sound.iter().map(compare);
        let worth = |d: &Difference| d.lost + d.moved;
        differences
            .min_by(|a, b| worth(a).total_cmp(&worth(b)))
            .unwrap_or_default()
    }

    fn compared(&self, scan: &Decoded, sound: &Decoded, repeated: bool) -> Difference {
        let (mut points, mut due, mut lost, mut moved) = (0usize, 0usize, 0usize, 0usize);
        for (i, (&depth, &wanted)) in scan.depth.iter().zip(&sound.depth).enumerate() {
            due += usize::from(wanted.is_finite());
            if !depth.is_finite() {
                lost += usize::from(wanted.is_finite());
                continue;
            }
            points += 1;
            moved += usize::from(match wanted.is_finite() {
                true => {
                    let other = if repeated { sound.depth_sigma[i] } else { 0.0 };
                    (depth - wanted).abs() > SIGMAS * scan.depth_sigma[i].hypot(other)
                }
                false => self.is_gross(i, depth),
            });
        }
        let part = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        Difference {
            lost: part(lost, due),
            moved: part(moved, points),
        }
    }
}

/// Decodes a capture as any application does.
fn decoded(captured: &Capture) -> Result<Decoded> {
    check_modulation(&captured.manifest, &captured.images)?;
    Ok(captured.decode(Options::default())?.1)
}
