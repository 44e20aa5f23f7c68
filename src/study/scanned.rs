//! A scan within the process: frames as the device's optics give them, without ports, decoded and
//! held against the truth. What reaches the decoder is what a client would get; ports and links
//! change no byte of it (see the tests of `serve`), they only take time.

use super::score::{Score, score};
use phasmid_core::error::Result;
use phasmid_decode::{Decoded, Decoder, FrameStack, Options, Samples};
use phasmid_device::Firmware;
use phasmid_geometry::Rig;
use phasmid_host::{Captured, frame_of};
use phasmid_pattern::{Manifest, Pattern};
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::PixelFormat;
use phasmid_render as render;
use phasmid_render::{Renderer, shot::Shot, truth::Truth};

/// A device before a scene, whose geometry pass is done once for all its scans.
pub struct Stage {
    profile: Profile,
    renderer: Renderer,
    shots: Vec<(Pattern, Shot)>,
}

/// The frames of one sequence.
pub struct Scanned {
    /// What was projected.
    pub manifest: Manifest,
    /// The true rig.
    pub rig: Rig,
    /// Columns and rows of a frame.
    pub size: (usize, usize),
    /// One for each of the manifest's, row by row.
    pub frames: Vec<Levels>,
}

/// The grey levels of a frame, in the low bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Levels {
    /// Of up to 8 bits.
    U8(Vec<u8>),
    /// Of more.
    U16(Vec<u16>),
}

impl Levels {
    /// Of a frame's bytes: one a pixel, or two, the low one first.
    pub fn of_bytes(bytes: Vec<u8>, single: bool) -> Self {
        if single {
            return Self::U8(bytes);
        }
        let (pairs, _) = bytes.as_chunks();
        Self::U16(pairs.iter().map(|&two| u16::from_le_bytes(two)).collect())
    }

    /// As the decoder takes them.
    pub fn samples(&self) -> Samples<'_> {
        match self {
            Self::U8(levels) => Samples::U8(levels),
            Self::U16(levels) => Samples::U16(levels),
        }
    }
}

impl Stage {
    /// Puts the profile's device before a scene. `seed` keys the sensor's noise.
    ///
    /// # Errors
    /// What [`Renderer::with_options`] and [`Firmware::new`] refuse.
    pub fn new(
        profile: &Profile,
        scene: &Scene,
        seed: u64,
        options: render::Options,
    ) -> Result<Self> {
        let shots = Firmware::new(profile, &[])?.selected_sequence();
        let mut renderer = Renderer::with_options(profile, scene, seed, options)?;
        renderer.expect_pattern_images(
            shots
                .iter()
                .filter_map(|(_, shot)| shot.pattern_image.as_deref()),
        );
        Ok(Self {
            profile: profile.clone(),
            renderer,
            shots,
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

    /// Scans with the noise of the `turn`th scan of the device.
    pub fn scan(&mut self, turn: u64) -> Scanned {
        let count = self.shots.len() as u64;
        let frames = self.shots.iter().enumerate().map(|(i, (_, shot))| {
            let id = turn * count + i as u64;
            let shot = Shot {
                id,
                noise_id: id,
                ..shot.clone()
            };
            let frame = self.renderer.expose(&shot);
            Levels::of_bytes(frame.data, frame.format == PixelFormat::Grey)
        });
        let frames = frames.collect();
        let camera = &self.profile.camera;
        Scanned {
            manifest: self.profile.manifest(&self.profile.sequence[0]),
            rig: self.profile.nominal_rig(),
            size: (camera.width_px as usize, camera.height_px as usize),
            frames,
        }
    }

    /// The truth of the scans.
    pub fn truth(&mut self) -> Truth {
        self.renderer.truth(&self.shots)
    }
}

impl Scanned {
    /// As a scanner captures it, calibrated with the true rig.
    pub fn captured(&self) -> Captured {
        let frames = self.frames.iter().enumerate();
        Captured {
            idn: String::new(),
            manifest: self.manifest.clone(),
            calibration: Some(self.rig),
            frames: frames
                .map(|(i, levels)| frame_of(&levels.samples(), self.size, i))
                .collect(),
        }
    }

    /// The decoder of such scans, with the true rig.
    ///
    /// # Errors
    /// A sequence that cannot be decoded.
    pub fn decoder(&self, options: Options) -> Result<Decoder> {
        let (width, height) = self.size;
        Decoder::new(&self.manifest, width, height, Some(&self.rig), options)
    }

    /// Decodes.
    ///
    /// # Errors
    /// What [`Decoder::decode`] refuses.
    pub fn decode(&self, decoder: &Decoder) -> Result<Decoded> {
        let mut out = Decoded::default();
        self.decode_into(decoder, &mut out)?;
        Ok(out)
    }

    /// Decodes into maps that are there.
    ///
    /// # Errors
    /// What [`Decoder::decode_into`] refuses.
    pub fn decode_into(&self, decoder: &Decoder, out: &mut Decoded) -> Result<()> {
        let (width, height) = self.size;
        let samples = self.frames.iter().map(Levels::samples).collect();
        decoder.decode_into(&FrameStack::new(width, height, samples)?, out)
    }

    /// Decodes with default options and scores.
    ///
    /// # Errors
    /// What [`Self::decoder`], [`Self::decode`] and [`score`] refuse.
    pub fn scored(&self, truth: &Truth) -> Result<(Decoded, Score)> {
        let decoded = self.decode(&self.decoder(Options::default())?)?;
        let score = score(&decoded, truth, &self.manifest, &self.rig)?;
        Ok((decoded, score))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_as_the_demo_does() {
        let profile = Profile::load("webcam-grey").unwrap();
        let scene = Scene::load("sphere").unwrap();
        let mut stage = Stage::new(&profile, &scene, 1, render::Options::default()).unwrap();
        let [first, second] = [0, 1].map(|turn| stage.scan(turn));
        assert_ne!(first.frames, second.frames, "noise of its own");
        // Four steps leave the image of the held pixels in the phase, which the bound does not
        // have.
        let truth = stage.truth();
        for scanned in [first, second] {
            let (_, score) = scanned.scored(&truth).unwrap();
            assert!(
                score.coverage > 0.95 && score.ratio_to_bound < 1.4,
                "{score:?}"
            );
        }
    }
}
