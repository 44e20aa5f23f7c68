//! One pod: renders its frames at a device time, and decodes them to points.

use crate::scanned::capture;
use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_decode::{Capture, Decoded, Options, SparseDecoder};
use phasmid_device::Device;
use phasmid_geometry::{Pose, Rig};
use phasmid_pattern::Pattern;
use phasmid_profile::{Profile, RigPlace, Scene};
use phasmid_render::led::{Model, Source};
use phasmid_render::{Renderer, shot::Shot, truth::Truth};
use phasmid_sgrt::{Measured, PIXELS};

/// A pod in front of a scene.
pub struct Pod {
    profile: Profile,
    rig: Rig,
    renderer: Renderer,
    shots: Vec<(Pattern, Shot)>,
    decoder: SparseDecoder,
    room_from_rig: Pose,
    scans: u64,
    /// Light source of the profile, if it has one: it is cold when it is switched on, at device time 0.
    source: Option<Source>,
}

impl Pod {
    /// Creates a device at a place in a scene. `seed` keys its noise.
    ///
    /// # Errors
    /// Returns the errors of [`Device`] and [`SparseDecoder::new`].
    pub fn new(profile: &Profile, scene: &Scene, place: RigPlace, seed: u64) -> Result<Self> {
        let scene = Scene {
            rig: place,
            ..scene.clone()
        };
        let device = Device::builder(profile, &scene).seed(seed).build()?;
        let rig = profile.nominal_rig();
        let source = profile.projector.led.as_ref().map(|led| {
            let mut source = Source::new(Model::new(led));
            source.drive(0, 1.0);
            source
        });
        Ok(Self {
            decoder: decoder(profile, &rig)?,
            source,
            profile: profile.clone(),
            rig,
            shots: device.shots(),
            renderer: device.renderer,
            room_from_rig: scene.rig_from_scene().inverse(),
            scans: 0,
        })
    }

    /// Returns the renderer, for example to force terms.
    pub fn renderer(&mut self) -> &mut Renderer {
        &mut self.renderer
    }

    /// Replaces the calibration with which frames are decoded. It may differ from the true rig, like a
    /// calibration of another day.
    ///
    /// # Errors
    /// Returns the errors of [`SparseDecoder::new`].
    pub fn calibrated(&mut self, rig: &Rig) -> Result<()> {
        self.decoder = decoder(&self.profile, rig)?;
        self.rig = *rig;
        Ok(())
    }

    /// Sets the assumed pose of the pod, which may differ from the true pose.
    pub fn placed(&mut self, room_from_rig: Pose) {
        self.room_from_rig = room_from_rig;
    }

    /// Returns the device's profile.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Returns the rig with which frames are decoded.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Returns the nanoseconds from the start of the first exposure to the end of the last one.
    pub fn duration_ns(&self) -> u64 {
        let ends = self.shots.iter().map(|(_, shot)| shot.end_ns()).max();
        let begin = self.shots.iter().map(|(_, shot)| shot.start_ns).min();
        ends.unwrap_or(0) - begin.unwrap_or(0)
    }

    /// Returns the nanoseconds after which the next pod may begin.
    pub fn turn_ns(&self) -> u64 {
        let period = match self.shots.as_slice() {
            [(_, first), (_, second), ..] => second.start_ns - first.start_ns,
            _ => self.duration_ns(),
        };
        period * self.shots.len() as u64
    }

    /// Renders frames from a device time on, each with its own noise. If `still_ns` is given, all
    /// exposures are centred on that time. Scans of a pod whose light fades must be in the order of
    /// device time.
    ///
    /// # Errors
    /// Returns no error for frames of this device.
    pub fn scan(&mut self, start_ns: u64, still_ns: Option<u64>) -> Result<Capture> {
        let count = self.shots.len() as u64;
        let zero_ns = self.shots.first().map_or(0, |(_, shot)| shot.start_ns);
        let frames = self.shots.iter().enumerate().map(|(i, (_, shot))| {
            let id = self.scans * count + i as u64;
            let start_ns = match still_ns {
                None => start_ns + (shot.start_ns - zero_ns),
                Some(then_ns) => then_ns.saturating_sub(shot.exposure_ns / 2),
            };
            let shot = Shot {
                id,
                noise_id: id,
                start_ns,
                emission: self.source.as_mut().map(|s| s.emission(start_ns)),
                ..shot.clone()
            };
            self.renderer.expose(&shot)
        });
        let frames = frames.collect();
        self.scans += 1;
        capture(&self.profile, self.rig, frames)
    }

    /// Returns the assumed pose of the rig in the room.
    pub fn room_from_rig(&self) -> Pose {
        self.room_from_rig
    }

    /// Decodes as many pixels as tracking needs ([`PIXELS`]).
    ///
    /// # Errors
    /// Returns the decoder's errors.
    pub fn decode(&self, capture: &Capture) -> Result<Decoded> {
        let mut out = Decoded::default();
        self.decoder.decode_into(&capture.images, &mut out)?;
        Ok(out)
    }

    /// Adds at most `most` decoded points to `measured`.
    pub fn measure(&self, decoded: &Decoded, measured: &mut Measured, most: usize) {
        let mut points = Vec::new();
        self.decoder.decoder().points_into(decoded, &mut points);
        let depths = decoded.depth.iter().zip(&decoded.depth_sigma);
        let known = depths.filter(|(depth, _)| !depth.is_nan());
        let sigma: Vec<f32> = known.map(|(_, sigma)| *sigma).collect();
        measured.push_pod(&points, &sigma, &self.room_from_rig, most);
    }

    /// Returns the decoded points in the room's frame, in millimetres.
    pub fn points(&self, decoded: &Decoded) -> Vec<DVec3> {
        let mut points = Vec::new();
        self.decoder.decoder().points_into(decoded, &mut points);
        points
            .iter()
            .map(|p| {
                self.room_from_rig
                    .point(DVec3::from_array(p.map(f64::from)))
            })
            .collect()
    }

    /// Returns the truth at a device time.
    pub fn truth(&mut self, time_ns: u64) -> Truth {
        self.renderer.truth_at(&self.shots, time_ns)
    }

    /// Returns the point of a pixel at a depth, in the room's frame.
    pub fn place(&self, pixel: usize, depth_mm: f64) -> DVec3 {
        let width = self.profile.camera.width_px as usize;
        let (x, y) = ((pixel % width) as f64, (pixel / width) as f64);
        let ray = self.rig.camera.ray(glam::DVec2::new(x, y));
        self.room_from_rig.point(ray * (depth_mm / ray.z))
    }
}

/// Creates the decoder for a pod's frames.
fn decoder(profile: &Profile, rig: &Rig) -> Result<SparseDecoder> {
    let camera = &profile.camera;
    SparseDecoder::new(
        &profile.manifest(&profile.sequence[0]),
        [camera.width_px, camera.height_px].map(|n| n as usize),
        Some(rig),
        Options::default(),
        PIXELS,
    )
}
