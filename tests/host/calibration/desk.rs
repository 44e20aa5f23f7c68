//! A board in front of an emulated scanner, in one process: poses, frames, images and decoded maps.

use phasmid::calibrate::board::BoardImage;
use phasmid::calibrate::rig::{Calibration, PoseData, Task, calibrate, sight};
use phasmid::calibrate::solve::Choice;
use phasmid::decode::{Decoded, Decoder, Options};
use phasmid::emulator::render::Renderer;
use phasmid::emulator::{PatternImage, Shot};
use phasmid::geometry::board_poses::{Wanted, poses};
use phasmid::geometry::{Board, Pose, Rig};
use phasmid::pattern::{Image, Manifest};
use phasmid::profile::{Profile, Scene};
use std::sync::Arc;

/// A scanner and the board in front of it.
pub struct Desk {
    pub profile: Profile,
    pub rig: Rig,
    pub board: Board,
    manifest: Manifest,
    shots: Vec<Shot>,
    decoder: Decoder,
}

impl Desk {
    /// Returns a built-in scanner that projects its sequence for calibration, and a board.
    pub fn new(profile: &str, board: Board) -> Self {
        Self::of(Profile::load(profile).unwrap(), board)
    }

    /// Returns a scanner that projects its sequence for calibration, and a board.
    pub fn of(profile: Profile, board: Board) -> Self {
        let manifest = profile.manifest(profile.calibration_sequence().unwrap());
        let rig = profile.nominal_rig();
        let lens = &rig.camera.lens;
        let (w, h) = (lens.width_px as usize, lens.height_px as usize);
        let options = Options {
            noise: rig.noise,
            ..Options::default()
        };
        Self {
            shots: shots(&profile, &manifest),
            decoder: Decoder::new(&manifest, w, h, None, options).unwrap(),
            rig,
            board,
            manifest,
            profile,
        }
    }

    /// Returns poses of the board for a calibration, as `camera_from_board`.
    pub fn poses(&self, wanted: &Wanted) -> Vec<Pose> {
        poses(&self.board, &self.rig, wanted).unwrap()
    }

    /// Captures the image and the decoded maps of the board in one pose.
    pub fn shoot(&self, pose: &Pose, seed: u64) -> (BoardImage, Decoded) {
        let mut renderer = Renderer::new(&self.profile, &self.scene(pose), seed).unwrap();
        let frames: Vec<_> = self.shots.iter().map(|s| renderer.expose(s).data).collect();
        let lens = &self.rig.camera.lens;
        let (w, h) = (lens.width_px as usize, lens.height_px as usize);
        let images: Vec<_> = frames
            .iter()
            .map(|f| Image::new(w, h, f.clone()).unwrap())
            .collect();
        let noise = self.rig.noise.unwrap();
        let image = BoardImage::from_frames(&self.manifest, &images, &noise).unwrap();
        (image, self.decoder.decode(&images).unwrap())
    }

    /// Captures the board in all poses, each with noise of its own.
    pub fn sight(&self, poses: &[Pose], seed: u64) -> Vec<PoseData> {
        let sight = |(i, pose): (usize, &Pose)| {
            let (image, decoded) = self.shoot(pose, seed * 1000 + i as u64);
            sight(&self.board, &format!("pose_{i:02}"), &image, &decoded)
                .unwrap_or_else(|why| panic!("pose {i}: {why}"))
        };
        poses.iter().enumerate().map(sight).collect()
    }

    /// Calibrates from captured poses.
    pub fn calibrate(&self, seen: &[PoseData], choice: Choice) -> Calibration {
        let [camera_px, projector_px] = [&self.rig.camera, &self.rig.projector]
            .map(|view| [view.lens.width_px, view.lens.height_px]);
        let task = Task {
            board: &self.board,
            camera_px,
            projector_px,
            nominal: Some(&self.rig),
            noise: self.rig.noise,
            choice,
            stop: None,
        };
        calibrate(&task, seen, Vec::new()).unwrap()
    }

    fn scene(&self, pose: &Pose) -> Scene {
        let (position, rotation) = pose.to_xyz_deg();
        let Board::Dots {
            columns,
            rows,
            pitch_mm,
            dot_mm,
            marker_mm,
        } = self.board
        else {
            panic!("a board of dots");
        };
        let text = format!(
            "name = \"board\"\ndescription = \"A board\"\n[ambient]\nirradiance_w_m2 = 0.02\n\
             [[object]]\nposition_mm = {:?}\nrotation_deg = {:?}\nalbedo = 0.8\n\
             [object.shape]\nkind = \"board\"\nink = 0.06\n\
             board = {{ pattern = \"dots\", columns = {columns}, rows = {rows}, \
             pitch_mm = {pitch_mm:?}, dot_mm = {dot_mm:?}, marker_mm = {marker_mm:?} }}\n",
            position, rotation
        );
        Scene::parse(&text, "board.toml").unwrap()
    }
}

/// Returns the shots of a sequence.
pub fn shots(profile: &Profile, manifest: &Manifest) -> Vec<Shot> {
    let shot = |(i, pattern)| Shot {
        id: i as u64,
        noise_id: i as u64,
        pattern_index: Some(i as u32),
        pattern_image: Some(Arc::new(
            PatternImage::new(pattern, &profile.projector, &|_| unreachable!()).unwrap(),
        )),
        light: 1.0,
        exposure_ns: (profile.camera.exposure_us * 1e3) as u64,
        ..Shot::default()
    };
    let patterns = manifest.frame.iter().map(|frame| &frame.pattern);
    patterns.enumerate().map(shot).collect()
}
