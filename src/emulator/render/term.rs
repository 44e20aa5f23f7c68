//! The terms of image formation, each with the pass that computes it and what makes it needed.

use super::shade::Optics;
use super::world::World;
use crate::profile::Profile;
use serde::Serialize;
use std::fmt;

/// The passes of a rendering, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pass {
    /// Once per state of the scene.
    Geometry,
    /// Per frame: light to electrons.
    Exposure,
    /// Per frame: electrons to digital numbers.
    Sensor,
}

/// A term that a scene may not need. Left out it is not computed at all: no factor of one, no
/// branch a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Term {
    /// The camera's rays are undistorted, from a table.
    CameraDistortion,
    /// Projector coordinates are distorted.
    ProjectorDistortion,
    /// Shadow rays: some object may stand in another's light, or its own.
    Shadows,
    /// Vertex colours and textures.
    AlbedoMaps,
    /// Specular lobes: highlights.
    Specular,
    /// Lamps beside the projector.
    Lights,
    /// Footprints along x, over which slides that vary along x are averaged.
    FootprintX,
    /// Footprints along y.
    FootprintY,
    /// Mains flicker of ambient light and lamps.
    Flicker,
    /// Shot and read noise: random numbers are drawn.
    Noise,
}

impl fmt::Display for Term {
    /// As it is written in files and tables.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// What decides whether a term is needed.
pub(super) struct Needs<'a> {
    pub(super) profile: &'a Profile,
    pub(super) optics: &'a Optics,
    pub(super) world: &'a World,
}

impl Term {
    /// All terms in the order of the passes.
    pub const ALL: [Self; 10] = [
        Self::CameraDistortion,
        Self::ProjectorDistortion,
        Self::Shadows,
        Self::AlbedoMaps,
        Self::Specular,
        Self::Lights,
        Self::FootprintX,
        Self::FootprintY,
        Self::Flicker,
        Self::Noise,
    ];

    /// The pass that computes it.
    pub const fn pass(self) -> Pass {
        match self {
            Self::CameraDistortion
            | Self::ProjectorDistortion
            | Self::Shadows
            | Self::AlbedoMaps
            | Self::Specular
            | Self::Lights
            | Self::FootprintX
            | Self::FootprintY => Pass::Geometry,
            Self::Flicker => Pass::Exposure,
            Self::Noise => Pass::Sensor,
        }
    }

    /// Why a term that profile and scene do not need is there.
    pub(super) const fn why_added(self) -> &'static str {
        match self {
            Self::FootprintX => "some slide varies along x",
            Self::FootprintY => "some slide varies along y",
            _ => "asked for",
        }
    }
}

impl Needs<'_> {
    /// Whether profile and scene need a term, and why or why not.
    pub(super) fn decide(&self, term: Term) -> (bool, &'static str) {
        let choose = |needed, why, why_not| (needed, if needed { why } else { why_not });
        match term {
            Term::CameraDistortion => choose(
                self.optics.camera.lens.is_distorted(),
                "camera.distortion is not zero",
                "camera.distortion is zero",
            ),
            Term::ProjectorDistortion => choose(
                self.optics.projector.lens.is_distorted(),
                "projector.distortion is not zero",
                "projector.distortion is zero",
            ),
            Term::Shadows => choose(
                self.world.casts_shadows(),
                "some surface may stand in another's light",
                "one convex solid at most: it shades itself by facing away",
            ),
            Term::AlbedoMaps => choose(
                self.world.looks.any_map(),
                "some object has vertex colours or a texture",
                "each object has one albedo",
            ),
            Term::Specular => choose(
                self.world.looks.any_specular(),
                "some object has a specular lobe",
                "no object has a specular lobe",
            ),
            Term::Lights => choose(
                !self.optics.lamps.is_empty(),
                "the scene has lamps",
                "the scene has no [[light]]",
            ),
            Term::FootprintX => (false, "no slide varies along x"),
            Term::FootprintY => (false, "no slide varies along y"),
            Term::Flicker => choose(
                self.optics.flicker.is_some(),
                "some light flickers with the mains",
                "all light is steady",
            ),
            Term::Noise => choose(
                !self.profile.camera.sensor.noiseless,
                "the sensor has shot and read noise",
                "left out by --no-noise",
            ),
        }
    }
}
