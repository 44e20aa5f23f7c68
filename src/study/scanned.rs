//! A scan within this process: rendered frames are decoded and compared with the truth, without ports.
//! The decoder gets what a client would get: ports and links change no byte (see the tests of `serve`),
//! they only take time.

use super::score::{Score, score};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, Decoded, Options};
use phasmid_device::Device;
use phasmid_geometry::Rig;
use phasmid_pattern::{Pattern, Samples};
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::Frame;
use phasmid_render as render;
use phasmid_render::{Renderer, shot::Shot, truth::Truth};

/// A device in front of a scene; the geometry pass is done once for all scans.
pub struct Stage {
    profile: Profile,
    renderer: Renderer,
    shots: Vec<(Pattern, Shot)>,
}

impl Stage {
    /// Creates the profile's device in front of a scene. `seed` keys the sensor's noise.
    ///
    /// # Errors
    /// Returns the errors of building a [`Device`].
    pub fn new(
        profile: &Profile,
        scene: &Scene,
        seed: u64,
        options: render::Options,
    ) -> Result<Self> {
        let device = Device::builder(profile, scene);
        let device = device.seed(seed).options(options).build()?;
        Ok(Self {
            profile: profile.clone(),
            shots: device.shots(),
            renderer: device.renderer,
        })
    }

    /// Returns the renderer, for example to time it or to force terms.
    pub fn renderer(&mut self) -> &mut Renderer {
        &mut self.renderer
    }

    /// Returns the exposures of the sequence that is selected at power-on.
    pub fn shots(&self) -> &[(Pattern, Shot)] {
        &self.shots
    }

    /// Scans with the noise of the device's scan number `turn`; the capture has the true rig.
    ///
    /// # Errors
    /// Returns no error for frames of this device.
    pub fn scan(&mut self, turn: u64) -> Result<Capture> {
        let count = self.shots.len() as u64;
        let frames = self.shots.iter().enumerate().map(|(i, (_, shot))| {
            let id = turn * count + i as u64;
            let shot = Shot {
                id,
                noise_id: id,
                ..shot.clone()
            };
            self.renderer.expose(&shot)
        });
        let frames = frames.collect();
        capture(&self.profile, self.profile.nominal_rig(), frames)
    }

    /// Returns the truth of the scans.
    pub fn truth(&mut self) -> Truth {
        self.renderer.truth(&self.shots)
    }
}

/// Decodes a calibrated capture with default options and scores it.
///
/// # Errors
/// Returns an error if the capture has no calibration, and the errors of [`Capture::decode`] and
/// [`score`].
pub fn scored(capture: &Capture, truth: &Truth) -> Result<(Decoded, Score)> {
    let rig = capture.calibration.as_ref();
    let rig = rig.ok_or_else(|| Error::device("the capture has no calibration"))?;
    let (_, decoded) = capture.decode(Options::default())?;
    let score = score(&decoded, truth, &capture.manifest, rig)?;
    Ok((decoded, score))
}

/// Returns the grey levels of a rendered frame, row by row.
///
/// # Errors
/// Returns an error if the frame's number of bytes is wrong.
pub fn levels(frame: Frame) -> Result<Vec<f64>> {
    Ok(match frame.into_image()?.samples() {
        Samples::U8(levels) => levels.iter().map(|&level| f64::from(level)).collect(),
        Samples::U16(levels) => levels.iter().map(|&level| f64::from(level)).collect(),
    })
}

/// Combines rendered frames of a profile's first sequence and a rig into a capture.
///
/// # Errors
/// Returns an error if a frame's number of bytes is wrong.
pub fn capture(profile: &Profile, rig: Rig, frames: Vec<Frame>) -> Result<Capture> {
    let images = frames.into_iter().map(Frame::into_image);
    Ok(Capture {
        idn: String::new(),
        manifest: profile.manifest(&profile.sequence[0]),
        calibration: Some(rig),
        images: images.collect::<Result<_>>()?,
        frames: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_as_the_demo_does() {
        let profile = Profile::load("webcam-grey").unwrap();
        let scene = Scene::load("sphere").unwrap();
        let mut stage = Stage::new(&profile, &scene, 1, render::Options::default()).unwrap();
        let [first, second] = [0, 1].map(|turn| stage.scan(turn).unwrap());
        assert_ne!(first.images, second.images, "noise of its own");
        // With four steps, held pixels leave a periodic phase error that the bound does not contain.
        let truth = stage.truth();
        for scanned in [first, second] {
            let (_, score) = scored(&scanned, &truth).unwrap();
            assert!(
                score.coverage > 0.95 && score.ratio_to_bound < 1.4,
                "{score:?}"
            );
        }
    }
}
