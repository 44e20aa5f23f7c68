//! One scan of the bench, and the ways from it to depths.

use crate::scanned::Stage;
use phasmid_calibrate::height::{Given, Mapping};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{AxisMap, Capture, Decoded, Options};
use phasmid_geometry::Rig;
use phasmid_pattern::{Axis, Image, finest_fringe};
use phasmid_profile::{Profile, Scene};
use phasmid_render::{self as render, truth::Truth};

/// A scan with what was decoded of it and the truth.
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
    /// What [`Stage::new`] and decoding refuse.
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

    /// The true rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The coordinates along x.
    ///
    /// # Errors
    /// None with the bench's sequence.
    pub fn x(&self) -> Result<&AxisMap> {
        let x = self.decoded.x.as_ref();
        x.ok_or_else(|| Error::device("the sequence tells no columns"))
    }

    /// The phase-to-height mapping of which this scan, of the bare plane, is the reference.
    ///
    /// # Errors
    /// What [`Mapping::of_capture`] refuses.
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

    /// Depths in mm by a mapping.
    ///
    /// # Errors
    /// None with the bench's sequence.
    pub fn depths(&self, mapping: &Mapping) -> Result<Vec<f32>> {
        let x = self.x()?;
        let mut depth = vec![f32::NAN; x.coordinate.len()];
        let mut sigma = depth.clone();
        mapping.depths([&x.coordinate, &x.sigma], &mut depth, &mut sigma);
        Ok(depth)
    }

    /// Columns and rows of its frames.
    pub fn size(&self) -> (usize, usize) {
        let lens = &self.rig.camera.lens;
        (lens.width_px as usize, lens.height_px as usize)
    }

    /// A frame in grey levels.
    ///
    /// # Errors
    /// A frame that is not there or of more than 8 bits.
    pub fn frame(&self, index: usize) -> Result<&[u8]> {
        let levels = self.scanned.images.get(index).and_then(Image::as_u8);
        levels.ok_or_else(|| Error::device(format!("no frame {index} of 8 bits")))
    }
}

/// A mapping with the fringe frequency of another one.
pub fn with_f0_of(mapping: &Mapping, other: &Mapping) -> Mapping {
    mapping.clone().with(&Given {
        fringes_per_mm: Some(other.constants.fringes_per_mm),
        ..Given::default()
    })
}
