//! One scan of a device that has a bad day, and what came of it.

use crate::desk::{Desk, Link};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, Options};
use phasmid_device::Device;
use phasmid_host::{Camera, CommandPort, Intake, Progress, ScanOptions, Scanner, check_modulation};
use phasmid_measure::GROSS_MM;
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::faults::{Direction, Fault, Schedule, Side, Struck, What};
use phasmid_render::{Renderer, truth::Truth};
use std::time::Duration;

/// How long the host waits for a reply, in virtual time.
const REPLY_TIMEOUT: Duration = Duration::from_secs(2);
/// How long it waits for a frame.
const FRAME_TIMEOUT: Duration = Duration::from_millis(400);
/// Scans without faults that say where a sound one has gross errors, and as many more that say how
/// many it has elsewhere.
const SOUND: usize = 8;
/// So many more than that are noise.
const SLACK: usize = 2;
/// Part of a sound scan's points that another has at least to be called one of the scene.
const LEAST_POINTS: f64 = 0.9;

/// What came of a scan.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The right cloud: no more gross errors than noise makes, and hardly fewer points.
    Recovered,
    /// An error that says what is wrong.
    Reported(String),
    /// A cloud, and nobody says that it is none of the scene.
    Wrong {
        /// Points.
        points: usize,
        /// Gross errors where sound scans have none.
        gross: usize,
    },
}

/// A cloud in two figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cloud {
    /// Points.
    pub points: usize,
    /// Those that are more than 1 mm off, or where there is nothing, and in no pixel, nor beside one,
    /// that has been so in a sound scan: edges are seen twice at once and noise decides.
    pub gross: usize,
}

/// A device and how the host reaches it.
#[derive(Debug, Clone)]
pub struct Setting {
    /// How it is called in a table.
    pub name: String,
    /// The device.
    pub profile: Profile,
    /// What stands before it.
    pub scene: Scene,
    /// How frames reach the host.
    pub link: Link,
    /// What is spoken on the control port: a shipped dialect; SCPI when absent.
    pub dialect: Option<&'static str>,
}

/// Where scans are tried: a device before a scene, and how sound scans of it look.
pub struct Trial {
    setting: Setting,
    /// Frames, messages to the device and messages back of a sound scan.
    counts: [u64; 3],
    renderer: Option<Renderer>,
    truth: Truth,
    /// Fewest points of sound scans.
    least: usize,
    /// Most gross errors that noise makes.
    most: usize,
    /// Pixels, and those beside them, in which sound scans have had gross errors.
    fragile: Vec<bool>,
}

/// What a scan gave.
pub struct Tried {
    /// The cloud, or what the host says.
    pub cloud: Result<Cloud>,
    /// Why a run was thrown away.
    pub retries: Vec<String>,
    /// What struck.
    pub struck: Vec<Struck>,
}

impl Trial {
    /// A place with a device of a profile before a scene.
    ///
    /// # Errors
    /// Profiles and scenes that cannot be rendered, and a device that cannot even be scanned when all
    /// is well.
    pub fn new(setting: &Setting) -> Result<Self> {
        let mut setting = setting.clone();
        // Points are compared with the truth, so errors of the calibration are left out.
        setting.profile.factory_calibration.exact = true;
        let profile = &setting.profile;
        let mut device = Device::builder(profile, &setting.scene).seed(1).build()?;
        let shots = device.shots();
        let truth = device.renderer.truth(&shots);
        let mut trial = Self {
            setting,
            counts: [0; 3],
            renderer: Some(device.renderer),
            fragile: vec![false; truth.depth_mm.len()],
            truth,
            least: usize::MAX,
            most: 0,
        };
        let mut scans = Vec::new();
        trial
            .with_desk(&Schedule::default(), |trial, desk| {
                let mut scanner = trial.scanner(desk)?;
                for _ in 0..2 * SOUND {
                    let captured = scanner.scan(&trial.options(), &mut |_| {})?;
                    scans.push(depth(&captured)?);
                }
                scanner.finish()
            })?
            .0?;
        let (first, others) = scans.split_at(SOUND);
        trial.fragile = trial.beside(first);
        for depth in others {
            let cloud = trial.cloud(depth);
            trial.least = trial.least.min(cloud.points);
            trial.most = trial.most.max(cloud.gross + SLACK);
        }
        trial.count()?;
        Ok(trial)
    }

    /// Counts what a sound scan consists of, by faults that strike everything and change nothing.
    fn count(&mut self) -> Result<()> {
        let harmless = [
            Fault {
                by_ms: Some(0.0),
                ..Fault::new(What::Late)
            },
            Fault {
                direction: Some(Direction::ToDevice),
                rate: Some(0.0),
                ..Fault::new(What::BitErrors)
            },
            Fault {
                by_ms: Some(0.0),
                ..Fault::new(What::LateReply)
            },
        ];
        let struck = self.scan(&Schedule {
            seed: 0,
            fault: harmless.to_vec(),
        })?;
        struck.cloud?;
        self.counts = [What::Late, What::BitErrors, What::LateReply]
            .map(|what| struck.struck.iter().filter(|s| s.what == what).count() as u64);
        Ok(())
    }

    /// Frames, messages to the device and messages back of a sound scan.
    pub fn counts(&self) -> [u64; 3] {
        self.counts
    }

    /// How many frames or messages of a sound scan a fault could strike.
    pub fn events(&self, fault: &Fault) -> u64 {
        let [frames, asked, answered] = self.counts;
        match (fault.side(), fault.what) {
            (Side::Camera, _) => frames,
            (_, What::Nak | What::Disconnect | What::Reset) => asked,
            (_, What::BitErrors) if fault.direction == Some(Direction::ToDevice) => asked,
            _ => answered,
        }
    }

    /// Does something with a device, and gives what came of it and what struck.
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

    /// Scans while a schedule is in force.
    ///
    /// # Errors
    /// A device that cannot be made. What the host says is in the result.
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
            Ok(trial.cloud(&depth(&captured)?))
        })?;
        Ok(Tried {
            cloud,
            retries,
            struck,
        })
    }

    /// What a scan came to.
    pub fn judge(&self, tried: &Tried) -> Outcome {
        match &tried.cloud {
            Err(error) => Outcome::Reported(error.to_string()),
            Ok(cloud) if self.is_sound(*cloud) => Outcome::Recovered,
            Ok(cloud) => Outcome::Wrong {
                points: cloud.points,
                gross: cloud.gross,
            },
        }
    }

    fn is_sound(&self, cloud: Cloud) -> bool {
        cloud.gross <= self.most && cloud.points as f64 >= LEAST_POINTS * self.least as f64
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

    /// Whether a measured depth is more than 1 mm off, or where there is nothing.
    fn is_gross(&self, pixel: usize, measured: f32) -> bool {
        // NaN, where there is nothing, is no small error.
        let small = f64::from(measured - self.truth.depth_mm[pixel]).abs() <= GROSS_MM;
        measured.is_finite() && !small
    }

    /// Pixels in which scans have gross errors, and those beside them.
    fn beside(&self, scans: &[Vec<f32>]) -> Vec<bool> {
        let width = self.setting.profile.camera.width_px as usize;
        let mut fragile = vec![false; self.truth.depth_mm.len()];
        for depth in scans {
            for (pixel, &measured) in depth.iter().enumerate() {
                if !self.is_gross(pixel, measured) {
                    continue;
                }
                let (x, y) = (pixel % width, pixel / width);
                for y in y.saturating_sub(1)..=y + 1 {
                    for x in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                        if let Some(beside) = fragile.get_mut(y * width + x) {
                            *beside = true;
                        }
                    }
                }
            }
        }
        fragile
    }

    /// Holds a scan's points against the truth.
    fn cloud(&self, depth: &[f32]) -> Cloud {
        let gross = |at: &(usize, &f32)| !self.fragile[at.0] && self.is_gross(at.0, *at.1);
        Cloud {
            points: depth.iter().filter(|measured| measured.is_finite()).count(),
            gross: depth.iter().enumerate().filter(gross).count(),
        }
    }
}

/// Decodes a capture, as any application does; NaN where nothing was measured.
fn depth(captured: &Capture) -> Result<Vec<f32>> {
    check_modulation(&captured.manifest, &captured.images)?;
    let (_, decoded) = captured.decode(Options::default())?;
    Ok(decoded.depth)
}
