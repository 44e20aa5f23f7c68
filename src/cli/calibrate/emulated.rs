//! Captures poses with an emulated device: places a board in front of the device in each pose and
//! scans over the device's ports, which stay open for all poses.

use super::args::Args;
use super::folder::CAPTURES;
use super::session::{Gathered, Session};
use crate::cli::interrupt::{check, flow, interrupted, remove_run_dir_at_exit};
use crate::cli::output::{printed, tell};
use crate::cli::scan::blame_dialect;
use crate::facade::connected;
use crate::{ScanOptions, Scanner};
use phasmid_calibrate::rig::look;
use phasmid_core::error::{Error, Result};
use phasmid_decode::Capture;
use phasmid_device::Device;
use phasmid_device::link::{ServeOptions, Serving};
use phasmid_geometry::board_poses::{Wanted, poses};
use phasmid_geometry::{Board, Pose, Rig};
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::service::{ClockPace, Placement, Request, ask};
use phasmid_render::Options as RenderOptions;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

/// Timeout for a reply or a frame. The first frame waits until the scene is prepared.
const TIMEOUT: Duration = Duration::from_secs(30);

/// Reflectance of the paper, chosen so that a board as near as 700 mm does not saturate: the
/// built-in devices expose a white wall at 1 m to three quarters of the full well.
const PAPER: f64 = 0.45;
/// Ambient irradiance in W/m^2, as in the built-in scenes.
const AMBIENT_W_M2: f64 = 0.02;

/// Allowed range of `--max-tilt-deg`. Boards that are all parallel do not determine the calibration;
/// at steeper tilts a board is hardly visible.
const TILT_DEG: RangeInclusive<f64> = 1.0..=60.0;

/// An emulated device to calibrate, and the poses in which it is shown the board.
pub(super) struct Emulated {
    board: Board,
    sequence: String,
    /// The poses, `rig_from_board`, rebuilt from the positions and angles that the device receives.
    shown: Vec<Pose>,
    truth: Rig,
}

fn profile(args: &Args, name: &str) -> Result<Profile> {
    Profile::load_with(name, &args.set.of_profile()?)
}

impl Emulated {
    /// Chooses the sequence and the poses. Does not start the device.
    ///
    /// # Errors
    /// Returns an error if the profile or an option is invalid, the profile has no sequence with
    /// patterns along both axes, or the board cannot be shown.
    pub(super) fn new(args: &Args, name: &str) -> Result<Self> {
        render_options(args).checked()?;
        if !TILT_DEG.contains(&args.max_tilt_deg) {
            let (least, most) = (TILT_DEG.start(), TILT_DEG.end());
            let allowed = format!("{least} to {most}");
            return Err(Error::input("--max-tilt-deg", args.max_tilt_deg, allowed));
        }
        let profile = profile(args, name)?;
        // A profile's `board_scale` applies to its board of dots only.
        let board = match args.board.board(1.0)? {
            chess @ Board::Chess { .. } => chess,
            Board::Dots { .. } => {
                let scale = profile.calibration.board_scale.unwrap_or(1.0);
                args.board.board(scale)?
            }
        };
        let sequence = profile.calibration_sequence().ok_or_else(|| {
            Error::input(
                format!("profile {name}: sequence"),
                "none with patterns along both axes",
                "one with fringes or Gray code along x and along y",
            )
        })?;
        let truth = profile.nominal_rig();
        let usual = Wanted::default();
        let wanted = Wanted {
            seed: args.seed,
            count: args.poses as usize,
            distance_mm: args.distance_mm.or(profile.calibration.distance_mm),
            tilt_deg: [usual.tilt_deg[0].min(args.max_tilt_deg), args.max_tilt_deg],
            ..usual
        };
        let poses = poses(&board, &truth, &wanted)?;
        let told = |pose: &Pose| {
            let (position, rotation) = pose.to_xyz_deg();
            Pose::from_xyz_deg(position, rotation)
        };
        Ok(Self {
            board,
            sequence: sequence.name.clone(),
            shown: poses.iter().map(told).collect(),
            truth,
        })
    }

    /// Returns the board.
    pub(super) fn board(&self) -> &Board {
        &self.board
    }

    /// Returns the true rig of the device.
    pub(super) fn truth(&self) -> &Rig {
        &self.truth
    }

    /// Returns the true poses, `camera_from_board`.
    pub(super) fn shown(&self) -> Vec<Pose> {
        let camera_from_rig = self.truth.camera.rig_from_view.inverse();
        self.shown
            .iter()
            .map(|&pose| camera_from_rig * pose)
            .collect()
    }

    /// Returns the names of the poses, in order.
    pub(super) fn names(&self) -> Vec<String> {
        let digits = (self.shown.len() - 1).to_string().len().max(2);
        (0..self.shown.len())
            .map(|i| format!("pose_{i:0digits$}"))
            .collect()
    }

    /// Scans the board in all poses, and decodes each pose while the next one is captured. Saves
    /// annotated images, and with `--keep-captures` the captures, in `folder`. Returns the poses and
    /// the device's identification.
    ///
    /// # Errors
    /// Returns an error if the device fails or a file cannot be written.
    pub(super) fn scan(
        &self,
        args: &Args,
        name: &str,
        folder: &Path,
        progress: impl FnMut(usize, usize),
    ) -> Result<(Gathered, String)> {
        let names = self.names();
        // Declare `_run_dir` before the device, so that it is dropped after the device.
        let _run_dir;
        let served = self.serve(args, name)?;
        let endpoints = served.endpoints();
        _run_dir = remove_run_dir_at_exit(&endpoints.control);
        let options = ScanOptions {
            sequence: Some(self.sequence.clone()),
            reply_timeout: TIMEOUT,
            frame_timeout: TIMEOUT,
            ..ScanOptions::default()
        };
        let mut scanner = Scanner::connect(&endpoints.camera, &endpoints.control, options)?;
        let (sender, receiver) = sync_channel(1);
        let session = Session::new(folder, &names);
        let keep = args.keep_captures.then(|| folder.join(CAPTURES));
        let looked = std::thread::scope(|scope| {
            let analysis = std::thread::Builder::new()
                .spawn_scoped(scope, || {
                    look_at_all(receiver, &self.board, session, keep, &names)
                })
                .map_err(|e| Error::io("the thread that analyses the captures", e))?;
            let scan = || scanner.scan_with(|_| flow());
            let captured = self.capture(&endpoints.service, &names, scan, sender, progress);
            // An error of the analysis takes precedence over an error of the capture, which then
            // stops only because the channel is closed.
            let session = analysis.join().unwrap_or_else(|_| {
                Err(Error::device(
                    "the thread that analyses the captures panicked",
                ))
            })?;
            Ok((session.finish(), captured?))
        });
        let finished = scanner.finish();
        let looked = looked.map_err(|why| blame_dialect(why, name))?;
        finished?;
        served.stop()?;
        Ok(looked)
    }

    /// Serves the device with the fast clock, in front of the board.
    fn serve(&self, args: &Args, name: &str) -> Result<Serving> {
        let mut profile = profile(args, name)?;
        profile.camera.sensor.noiseless |= args.no_noise;
        let scene = scene(&self.board, &self.shown[0])?;
        let device = Device::builder(&profile, &scene)
            .seed(args.seed)
            .options(render_options(args));
        let mut device = device.build()?;
        tell(name, &mut device)?;
        check()?;
        device.serve(&ServeOptions {
            clock: ClockPace::Fast,
            notice: printed(),
            ..ServeOptions::default()
        })
    }

    /// Captures the poses in order until the receiver is gone. Returns the device's identification.
    fn capture(
        &self,
        socket: &Path,
        names: &[String],
        mut scan: impl FnMut() -> Result<Capture>,
        sender: SyncSender<Taken>,
        mut progress: impl FnMut(usize, usize),
    ) -> Result<String> {
        let mut service = connected(socket)?;
        let mut idn = String::new();
        capture_each(names, sender, interrupted, |place| {
            progress(place, self.shown.len());
            let (position, rotation) = self.shown[place].to_xyz_deg();
            let placement = Placement {
                object: 0,
                position_mm: position,
                rotation_deg: rotation,
            };
            ask(&mut service, Request::Place(placement))?;
            let captured = scan()?;
            idn.clone_from(&captured.idn);
            Ok(captured)
        })?;
        Ok(idn)
    }
}

/// Index of a pose, and its capture or the error of capturing it.
type Taken = (usize, Result<Capture>);

/// Captures the poses in order until the receiver is gone. A pose that fails is left out. Two
/// failures in succession end the calibration, because then the device is probably at fault. After
/// an interrupt by the user, a single failure ends it.
fn capture_each(
    names: &[String],
    sender: SyncSender<Taken>,
    interrupted: impl Fn() -> bool,
    mut capture: impl FnMut(usize) -> Result<Capture>,
) -> Result<()> {
    let mut failed = false;
    for (place, name) in names.iter().enumerate() {
        let captured = capture(place);
        if captured.is_err() && (failed || interrupted()) {
            return captured.map(drop).map_err(|e| e.at(name));
        }
        failed = captured.is_err();
        if sender.send((place, captured)).is_err() {
            break;
        }
    }
    Ok(())
}

/// Decodes captures as they arrive, and saves them in the folder `keep` if there is one.
fn look_at_all(
    captures: Receiver<Taken>,
    board: &Board,
    mut session: Session,
    keep: Option<PathBuf>,
    names: &[String],
) -> Result<Session> {
    while let Ok((place, captured)) = captures.recv() {
        let name = &names[place];
        let captured = match captured {
            Ok(captured) => captured,
            Err(why) => {
                session.take(place, Err(why))?;
                continue;
            }
        };
        if let Some(folder) = &keep {
            captured.write(&folder.join(name))?;
        }
        let Capture {
            manifest,
            images,
            calibration,
            ..
        } = &captured;
        let looked = look(board, name, manifest, images, *calibration);
        session.take(place, looked)?;
    }
    Ok(session)
}

fn render_options(args: &Args) -> RenderOptions {
    RenderOptions {
        samples: args.samples,
        backend: args.backend.into(),
        ..RenderOptions::default()
    }
}

/// Returns the scene with a board in a pose.
///
/// # Errors
/// Returns an error if the board or the pose is invalid in a scene.
fn scene(board: &Board, rig_from_board: &Pose) -> Result<Scene> {
    Scene::parse(&scene_text(board, rig_from_board), "board")
}

fn scene_text(board: &Board, rig_from_board: &Pose) -> String {
    let (position, rotation) = rig_from_board.to_xyz_deg();
    let board = toml::Value::try_from(board).expect("numbers and words");
    format!(
        "name = \"board\"\ndescription = \"A calibration board\"\n\n\
         [ambient]\nirradiance_w_m2 = {AMBIENT_W_M2}\n\n\
         [[object]]\nposition_mm = {:?}\nrotation_deg = {:?}\nalbedo = {PAPER}\n\
         shape = {{ kind = \"board\", board = {board} }}\n",
        position, rotation
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use phasmid_pattern::{Manifest, ProjectorSize};

    fn nothing() -> Capture {
        Capture {
            idn: String::new(),
            manifest: Manifest {
                projector: ProjectorSize {
                    width_px: 1,
                    height_px: 1,
                },
                frame: Vec::new(),
            },
            calibration: None,
            images: Vec::new(),
            frames: Vec::new(),
        }
    }

    /// Captures four poses; those with an index in `failing` fail. Returns the received poses
    /// (index, success) and the result.
    fn run(failing: &[usize], interrupted: bool) -> (Vec<(usize, bool)>, Result<()>) {
        let names = ["a", "b", "c", "d"].map(str::to_owned);
        let (sender, receiver) = sync_channel(4);
        let outcome = capture_each(
            &names,
            sender,
            || interrupted,
            |place| match failing.contains(&place) {
                true => Err(Error::device("the frames do not follow the sequence")),
                false => Ok(nothing()),
            },
        );
        let taken = receiver.iter().map(|(place, c)| (place, c.is_ok()));
        (taken.collect(), outcome)
    }

    #[test]
    fn a_pose_that_fails_is_left_out_and_two_in_succession_end_the_calibration() {
        let (taken, outcome) = run(&[0, 2], false);
        assert_eq!(taken, [(0, false), (1, true), (2, false), (3, true)]);
        outcome.unwrap();
        let (taken, outcome) = run(&[1, 2], false);
        assert_eq!(taken, [(0, true), (1, false)]);
        let words = outcome.unwrap_err().to_string();
        assert_eq!(words, "c: the frames do not follow the sequence");
        let (taken, outcome) = run(&[3], true);
        assert_eq!(taken, [(0, true), (1, true), (2, true)]);
        assert!(outcome.is_err());
    }

    #[test]
    fn scene_holds_board_and_pose() {
        let at = Pose::from_xyz_deg(DVec3::new(1.5, -2e-7, 1000.0), DVec3::new(20.0, -31.5, 7.0));
        for board in [Board::DOTS.scaled(4.0), Board::CHESS] {
            let scene = scene(&board, &at).unwrap();
            assert_eq!(scene.object.len(), 1);
            let placed = scene.rig_from_object(&scene.object[0]);
            let off = (placed.rotation - at.rotation).to_cols_array();
            assert!(off.iter().all(|o| o.abs() < 1e-14));
            assert_eq!(placed.translation_mm, at.translation_mm);
        }
    }
}
