//! The terms of image formation, each with the pass that computes it, and sets of them.

use crate::pattern_image::PatternImage;
use phasmid_pattern::Axis;
use serde::Serialize;
use std::fmt;

/// The passes of rendering, in order.
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

/// An optional term of image formation. A term that is omitted costs nothing per pixel, not even a
/// factor or a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Term {
    /// Distortion of the camera's lens: its rays come from a table.
    CameraDistortion,
    /// Distortion of the projector's lens: projector coordinates are distorted.
    ProjectorDistortion,
    /// The camera's image darkens towards its edge.
    CameraVignetting,
    /// The projector's light falls towards the edge of its field.
    ProjectorVignetting,
    /// The projector is sharp at one distance: its pattern image is blurred over depth.
    ProjectorDefocus,
    /// Shadow rays: objects may shade each other or themselves.
    Shadows,
    /// The camera's pupil is a disc: objects out of focus are blurred.
    DepthOfField,
    /// Vertex colours, textures and boards.
    AlbedoMaps,
    /// Specular lobes: highlights.
    Specular,
    /// Lamps in addition to the projector.
    Lights,
    /// Light travels under skin: fringes lose contrast, and oblique light exits at a shifted point.
    Subsurface,
    /// Light that surfaces reflect onto each other: one diffuse bounce.
    Interreflection,
    /// Footprints along x, over which pattern images that vary along x are averaged.
    FootprintX,
    /// Footprints along y, over which pattern images that vary along y are averaged.
    FootprintY,
    /// The projector's light is a non-linear function of the pattern image's levels.
    ProjectorResponse,
    /// The projector emits light even where the pattern is black.
    ContrastRatio,
    /// Objects move: the light of an exposure is the mean over several instants.
    Motion,
    /// Mains flicker of ambient light and lamps.
    Flicker,
    /// Rows start one after the other, so each row has its own phase of the mains period and sees
    /// its own interval of the pattern sequence.
    RollingShutter,
    /// Patterns are shown for only a part of an exposure, and their light rises and fades: an
    /// exposure sees whatever the projector shows during it.
    PatternTiming,
    /// Veiling glare: light scattered over the whole image.
    Glare,
    /// Electrons that accumulate without light.
    DarkCurrent,
    /// PRNU and DSNU: a sensitivity and an offset of each pixel.
    FixedPattern,
    /// Charge beyond the full well spills along the column.
    Blooming,
    /// Shot and read noise: random numbers are drawn.
    Noise,
    /// Non-linear response of the digital numbers.
    CameraResponse,
}

impl fmt::Display for Pass {
    /// Formats the name used in files and tables.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl fmt::Display for Term {
    /// Formats the name used in files and tables.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl Term {
    /// All terms in the order of the passes.
    pub const ALL: [Self; 26] = [
        Self::CameraDistortion,
        Self::ProjectorDistortion,
        Self::CameraVignetting,
        Self::ProjectorVignetting,
        Self::ProjectorDefocus,
        Self::Shadows,
        Self::DepthOfField,
        Self::AlbedoMaps,
        Self::Specular,
        Self::Lights,
        Self::Subsurface,
        Self::Interreflection,
        Self::FootprintX,
        Self::FootprintY,
        Self::ProjectorResponse,
        Self::ContrastRatio,
        Self::Motion,
        Self::Flicker,
        Self::RollingShutter,
        Self::PatternTiming,
        Self::Glare,
        Self::DarkCurrent,
        Self::FixedPattern,
        Self::Blooming,
        Self::Noise,
        Self::CameraResponse,
    ];

    /// Returns the term of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|term| term.to_string() == name)
    }

    /// Returns the pass that computes the term.
    pub const fn pass(self) -> Pass {
        match self {
            Self::CameraDistortion
            | Self::ProjectorDistortion
            | Self::CameraVignetting
            | Self::ProjectorVignetting
            | Self::ProjectorDefocus
            | Self::Shadows
            | Self::DepthOfField
            | Self::AlbedoMaps
            | Self::Specular
            | Self::Lights
            | Self::Subsurface
            | Self::Interreflection
            | Self::FootprintX
            | Self::FootprintY => Pass::Geometry,
            Self::ProjectorResponse
            | Self::ContrastRatio
            | Self::Motion
            | Self::Flicker
            | Self::RollingShutter
            | Self::PatternTiming
            | Self::Glare => Pass::Exposure,
            Self::DarkCurrent
            | Self::FixedPattern
            | Self::Blooming
            | Self::Noise
            | Self::CameraResponse => Pass::Sensor,
        }
    }

    /// Returns the reason for including a term that profile and scene do not require.
    pub(super) const fn why_added(self) -> &'static str {
        match self {
            Self::FootprintX => "some pattern varies along x",
            Self::FootprintY => "some pattern varies along y",
            _ => "requested",
        }
    }
}

/// Set of the terms that are computed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Plan {
    /// One bit per element of [`Term::ALL`].
    terms: u64,
}

impl Plan {
    /// Returns whether a term is computed.
    pub const fn has(&self, term: Term) -> bool {
        self.terms >> term as u32 & 1 != 0
    }

    pub(super) fn set(&mut self, term: Term, included: bool) {
        let bit = 1 << term as u32;
        self.terms = if included {
            self.terms | bit
        } else {
            self.terms & !bit
        };
    }

    /// Adds the terms that a pattern needs; returns whether this changed the plan.
    pub(super) fn include(&mut self, pattern_image: &PatternImage) -> bool {
        let before = *self;
        match pattern_image {
            PatternImage::Uniform(_) => {}
            PatternImage::Row(Axis::X, _) => self.set(Term::FootprintX, true),
            PatternImage::Row(Axis::Y, _) => self.set(Term::FootprintY, true),
            PatternImage::Image { .. } => {
                self.set(Term::FootprintX, true);
                self.set(Term::FootprintY, true);
            }
        }
        *self != before
    }
}
