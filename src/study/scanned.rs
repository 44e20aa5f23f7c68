//! A scan within the process: frames as the device's optics give them, without ports, decoded and
//! held against the truth. What reaches the decoder is what a client would get; ports and links
//! change no byte of it (see the tests of `serve`), they only take time.

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

/// A device before a scene, whose geometry pass is done once for all its scans.
pub struct Stage {
    profile: Profile,
    renderer: Renderer,
    shots: Vec<(Pattern, Shot)>,
}

impl Stage {
    /// Puts the profile's device before a scene. `seed` keys the sensor's noise.
    ///
    /// # Errors
    /// Returns an error for what [`Device`] cannot be built from.
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

    /// The renderer, to be timed or forced.
    pub fn renderer(&mut self) -> &mut Renderer {
        &mut self.renderer
    }

    /// The exposures of the sequence that is selected at power-on.
    pub fn shots(&self) -> &[(Pattern, Shot)] {
        &self.shots
    }

    /// Scans with the noise of the `turn`th scan of the device; calibrated with the true rig.
    ///
    /// # Errors
    /// None with frames of this device.
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

    /// The truth of the scans.
    pub fn truth(&mut self) -> Truth {
        self.renderer.truth(&self.shots)
    }
}

/// Decodes a calibrated capture with default options and scores it.
///
/// # Errors
/// A capture without calibration; what [`Capture::decode`] and [`score`] refuse.
pub fn scored(capture: &Capture, truth: &Truth) -> Result<(Decoded, Score)> {
    let rig = capture.calibration.as_ref();
    let rig = rig.ok_or_else(|| Error::device("the capture has no calibration"))?;
    let (_, decoded) = capture.decode(Options::default())?;
    let score = score(&decoded, truth, &capture.manifest, rig)?;
    Ok((decoded, score))
}

/// The grey levels of a rendered frame, row by row.
///
/// # Errors
/// A frame whose number of bytes is wrong.
pub fn levels(frame: Frame) -> Result<Vec<f64>> {
    Ok(match frame.into_image()?.samples() {
        Samples::U8(levels) => levels.iter().map(|&level| f64::from(level)).collect(),
        Samples::U16(levels) => levels.iter().map(|&level| f64::from(level)).collect(),
    })
}

/// The capture of a profile's first sequence from its rendered frames, calibrated by a rig.
///
/// # Errors
/// Frames whose number of bytes is wrong.
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
        // Four steps leave the image of the held pixels in the phase, which the bound does not
        // have.
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
