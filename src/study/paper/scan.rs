//! One scan of the bench, and the methods that convert it to depths.

use crate::scanned::Stage;
use phasmid_calibrate::height::{Given, Mapping};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{AxisMap, Capture, Decoded, Options};
use phasmid_geometry::Rig;
use phasmid_pattern::{Axis, Image, finest_fringe};
use phasmid_profile::{Profile, Scene};
use phasmid_render::{self as render, truth::Truth};

/// A scan with its decoded maps and the truth.
pub struct Scan {
    /// The frames.
    pub scanned: Capture,
    /// The true rig.
    rig: Rig,
    /// Coordinates, and depths by triangulation.
    pub decoded: Decoded,
    /// The truth.
    pub truth: Truth,
}

impl Scan {
    /// Scans a scene once. `seed` keys the noise.
    ///
    /// # Errors
    /// Returns the errors of [`Stage::new`] and of the decoder.
    pub fn new(profile: &Profile, scene: &Scene, seed: u64) -> Result<Self> {
        let mut stage = Stage::new(profile, scene, seed, render::Options::default())?;
        let scanned = stage.scan(0)?;
        let (_, decoded) = scanned.decode(Options::default())?;
        Ok(Self {
            rig: profile.nominal_rig(),
            truth: stage.truth(),
            scanned,
            decoded,
        })
    }

    /// Returns the true rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Returns the coordinates along x.
    ///
    /// # Errors
    /// Returns no error for the bench's sequence.
    pub fn x(&self) -> Result<&AxisMap> {
        let x = self.decoded.x.as_ref();
        x.ok_or_else(|| Error::device("the sequence does not encode the columns"))
    }

    /// Returns the phase-to-height mapping whose reference is this scan of the bare plane.
    ///
    /// # Errors
    /// Returns the errors of [`Mapping::of_capture`].
    pub fn mapping(&self) -> Result<Mapping> {
        let patterns = self.scanned.manifest.frame.iter().map(|f| &f.pattern);
        let (_, period_px) =
            finest_fringe(patterns).ok_or_else(|| Error::device("the sequence has no fringes"))?;
        let x = self.x()?;
        let depth = [&self.decoded.depth[..], &self.decoded.depth_sigma];
        Mapping::of_capture(
            self.rig(),
            Axis::X,
            period_px,
            [&x.coordinate, &x.sigma],
            depth,
        )
    }

    /// Computes depths in mm with a mapping.
    ///
    /// # Errors
    /// Returns no error for the bench's sequence.
    pub fn depths(&self, mapping: &Mapping) -> Result<Vec<f32>> {
        let x = self.x()?;
        let mut depth = vec![f32::NAN; x.coordinate.len()];
        let mut sigma = depth.clone();
        mapping.depths([&x.coordinate, &x.sigma], &mut depth, &mut sigma);
        Ok(depth)
    }

    /// Returns columns and rows of the frames.
    pub fn size(&self) -> (usize, usize) {
        let lens = &self.rig.camera.lens;
        (lens.width_px as usize, lens.height_px as usize)
    }

    /// Returns a frame in grey levels.
    ///
    /// # Errors
    /// Returns an error if the frame does not exist or has more than 8 bits.
    pub fn frame(&self, index: usize) -> Result<&[u8]> {
        let levels = self.scanned.images.get(index).and_then(Image::as_u8);
        levels.ok_or_else(|| {
            Error::device(format!("frame {index} is missing or has more than 8 bits"))
        })
    }
}

/// Returns a mapping with the fringe frequency of another.
pub fn with_f0_of(mapping: &Mapping, other: &Mapping) -> Mapping {
    mapping.clone().with(&Given {
        fringes_per_mm: Some(other.constants.fringes_per_mm),
        ..Given::default()
    })
}
