//! The terms of image formation, each with the pass that computes it and what makes it needed.

use super::shade::Optics;
use super::world::World;
use phasmid_profile::Profile;
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

/// An optional term of image formation. If omitted, it costs nothing per pixel, not even a factor
/// or a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Term {
    /// The camera's rays are undistorted, from a table.
    CameraDistortion,
    /// Projector coordinates are distorted.
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
    /// Lamps beside the projector.
    Lights,
    /// Light travels under skin: fringes lose contrast, and oblique light exits shifted.
    Subsurface,
    /// Light that surfaces reflect onto each other: one diffuse bounce.
    Interreflection,
    /// Footprints along x, over which pattern images that vary along x are averaged.
    FootprintX,
    /// Footprints along y.
    FootprintY,
    /// The projector's light is a non-linear function of the pattern image's levels.
    ProjectorResponse,
    /// The projector's black emits light.
    ContrastRatio,
    /// Objects move: an exposure is the mean over instants.
    Motion,
    /// Mains flicker of ambient light and lamps.
    Flicker,
    /// Rows start one after the other: each has its own phase of the mains period and sees its own
    /// part of the pattern sequence.
    RollingShutter,
    /// Patterns are shown for a part of an exposure, and their light rises and fades: an exposure
    /// sees whatever is shown during it.
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

/// Inputs that decide whether a term is needed.
pub(super) struct Needs<'a> {
    pub(super) profile: &'a Profile,
    pub(super) optics: &'a Optics,
    pub(super) world: &'a World,
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

impl Needs<'_> {
    /// Returns whether profile and scene require a term, and the reason.
    pub(super) fn decide(&self, term: Term) -> (bool, &'static str) {
        let choose = |needed, why, why_not| (needed, if needed { why } else { why_not });
        let sensor = &self.profile.camera.sensor;
        match term {
            Term::CameraDistortion => choose(
                self.profile.camera.view().lens.is_distorted(),
                "camera.distortion is not zero",
                "camera.distortion is zero",
            ),
            Term::ProjectorDistortion => choose(
                self.optics.projector.lens.is_distorted(),
                "projector.distortion is not zero",
                "projector.distortion is zero",
            ),
            Term::CameraVignetting => choose(
                !self.profile.camera.vignetting.is_none(),
                "camera.vignetting is set",
                "camera.vignetting is not set",
            ),
            Term::ProjectorVignetting => choose(
                !self.profile.projector.vignetting.is_none(),
                "projector.vignetting is set",
                "projector.vignetting is not set",
            ),
            Term::ProjectorDefocus => choose(
                self.profile
                    .projector
                    .focus
                    .is_some_and(|focus| focus.aperture_mm > 0.0),
                "projector.focus has an aperture",
                "projector.focus is absent, or a pinhole's",
            ),
            Term::Shadows => choose(
                self.world.casts_shadows(),
                "some surface may shadow another",
                "one convex solid at most: it shades itself by facing away",
            ),
            Term::DepthOfField => choose(
                self.profile.camera.focus_mm.is_some(),
                "camera.focus_mm is given",
                "camera.focus_mm is absent: all is in focus",
            ),
            Term::AlbedoMaps => choose(
                self.world.materials.any_map(),
                "some object has vertex colours or a texture, or is a board",
                "each object has one albedo",
            ),
            Term::Specular => choose(
                self.world.materials.any_specular(),
                "some object has a specular lobe",
                "no object has a specular lobe",
            ),
            Term::Lights => choose(
                !self.optics.lamps.is_empty(),
                "the scene has lamps",
                "the scene has no [[light]] that is on",
            ),
            Term::Subsurface => choose(
                self.optics.skins.any(),
                "some object is skin",
                "no object is skin",
            ),
            Term::Interreflection => match self.optics.interreflection {
                None => (false, "the scene has no [interreflection]"),
                Some(_) => choose(
                    self.world.casts_shadows(),
                    "the scene has [interreflection]",
                    "one convex solid at most: it sees no other surface",
                ),
            },
            Term::FootprintX => (false, "no pattern varies along x"),
            Term::FootprintY => (false, "no pattern varies along y"),
            Term::ProjectorResponse => choose(
                self.profile
                    .projector
                    .response
                    .as_ref()
                    .is_some_and(|response| !response.is_straight()),
                "projector.response is not linear",
                "projector.response is absent or linear: light follows the levels",
            ),
            Term::ContrastRatio => choose(
                self.profile.projector.contrast_ratio.is_some(),
                "projector.contrast_ratio is set",
                "projector.contrast_ratio is absent: black is dark",
            ),
            Term::Motion => choose(
                self.world.moves(),
                "some object moves or deforms",
                "no object moves",
            ),
            Term::Flicker => choose(
                self.optics.flicker.is_some(),
                "some light flickers with the mains",
                "all light is steady",
            ),
            Term::RollingShutter => choose(
                self.profile.camera.line_time_ns() > 0,
                "camera.line_time_us is above 0",
                "camera.line_time_us is 0: the shutter is global",
            ),
            Term::PatternTiming => choose(
                self.profile.projector.timing.is_some() || self.profile.projector.led.is_some(),
                "projector.timing or projector.led is given",
                "neither projector.timing nor projector.led: patterns are shown at once, evenly",
            ),
            Term::Glare => choose(
                self.profile.camera.glare.is_some_and(|g| g.percent > 0.0),
                "camera.glare scatters light",
                "no camera.glare",
            ),
            Term::DarkCurrent => choose(
                sensor.dark_current_e_s > 0.0,
                "camera.sensor.dark_current_e_s is above 0",
                "camera.sensor.dark_current_e_s is 0",
            ),
            Term::FixedPattern => choose(
                sensor.prnu_percent > 0.0 || sensor.dsnu_e > 0.0,
                "camera.sensor has PRNU or DSNU",
                "camera.sensor has neither PRNU nor DSNU",
            ),
            Term::Blooming => choose(
                sensor.blooming_percent > 0.0,
                "camera.sensor.blooming_percent is above 0",
                "camera.sensor.blooming_percent is 0",
            ),
            Term::CameraResponse => choose(
                sensor.response.is_bent(),
                "camera.sensor.response is not linear",
                "camera.sensor.response is linear",
            ),
            Term::Noise => choose(
                !sensor.noiseless,
                "the sensor has shot and read noise",
                "left out by --no-noise",
            ),
        }
    }
}
