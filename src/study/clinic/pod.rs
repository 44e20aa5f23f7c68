//! One pod: its frames at a device time, decoded into what it measures.

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

/// A pod before a scene.
pub struct Pod {
    profile: Profile,
    rig: Rig,
    renderer: Renderer,
    shots: Vec<(Pattern, Shot)>,
    decoder: SparseDecoder,
    room_from_rig: Pose,
    scans: u64,
    /// Where the profile has a light source: on since device time 0, when it was cold.
    source: Option<Source>,
}

impl Pod {
    /// A device that stands at a place before a scene. `seed` keys its noise.
    ///
    /// # Errors
    /// What [`Device`] cannot be built from, and what [`SparseDecoder::new`] refuses.
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

    /// The rendering, to be forced.
    pub fn renderer(&mut self) -> &mut Renderer {
        &mut self.renderer
    }

    /// Decodes from now on by a calibration that need not be the rig as it stands: one of another
    /// day.
    ///
    /// # Errors
    /// What [`SparseDecoder::new`] refuses.
    pub fn calibrated(&mut self, rig: &Rig) -> Result<()> {
        self.decoder = decoder(&self.profile, rig)?;
        self.rig = *rig;
        Ok(())
    }

    /// Takes it from now on to stand where it need not: where it was located.
    pub fn placed(&mut self, room_from_rig: Pose) {
        self.room_from_rig = room_from_rig;
    }

    /// The device.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// The rig that it decodes by.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Nanoseconds from the first exposure's start to the last one's end.
    pub fn duration_ns(&self) -> u64 {
        let ends = self.shots.iter().map(|(_, shot)| shot.end_ns()).max();
        let begin = self.shots.iter().map(|(_, shot)| shot.start_ns).min();
        ends.unwrap_or(0) - begin.unwrap_or(0)
    }

    /// Nanoseconds after which the next pod may begin.
    pub fn turn_ns(&self) -> u64 {
        let period = match self.shots.as_slice() {
            [(_, first), (_, second), ..] => second.start_ns - first.start_ns,
            _ => self.duration_ns(),
        };
        period * self.shots.len() as u64
    }

    /// Takes frames from a device time on, with noise of their own; all of them in the middle of
    /// one exposure at `still_ns`, where that is given. Scans of a pod whose light fades come in
    /// the order of device time.
    ///
    /// # Errors
    /// None with frames of this device.
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

    /// Where its rig's frame stands in the room.
    pub fn room_from_rig(&self) -> Pose {
        self.room_from_rig
    }

    /// Decodes as many pixels as tracking needs ([`PIXELS`]).
    ///
    /// # Errors
    /// What the decoder refuses.
    pub fn decode(&self, capture: &Capture) -> Result<Decoded> {
        let mut out = Decoded::default();
        self.decoder.decode_into(&capture.images, &mut out)?;
        Ok(out)
    }

    /// Adds what was decoded to what is measured, at most so many points.
    pub fn measure(&self, decoded: &Decoded, measured: &mut Measured, most: usize) {
        let mut points = Vec::new();
        self.decoder.decoder().points_into(decoded, &mut points);
        let depths = decoded.depth.iter().zip(&decoded.depth_sigma);
        let known = depths.filter(|(depth, _)| !depth.is_nan());
        let sigma: Vec<f32> = known.map(|(_, sigma)| *sigma).collect();
        measured.push_pod(&points, &sigma, &self.room_from_rig, most);
    }

    /// The points that were decoded, in the room's frame in millimetres.
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

    /// The truth at a device time.
    pub fn truth(&mut self, time_ns: u64) -> Truth {
        self.renderer.truth_at(&self.shots, time_ns)
    }

    /// The pixel's point in the room at a depth.
    pub fn place(&self, pixel: usize, depth_mm: f64) -> DVec3 {
        let width = self.profile.camera.width_px as usize;
        let (x, y) = ((pixel % width) as f64, (pixel / width) as f64);
        let ray = self.rig.camera.ray(glam::DVec2::new(x, y));
        self.room_from_rig.point(ray * (depth_mm / ray.z))
    }
}

/// What decodes a pod's frames.
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
