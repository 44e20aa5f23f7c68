//! Plan: the terms of image formation that a scene and its patterns need, with reasons. Computing a
//! term that the plan omits would not change a byte of a frame.

use crate::exposure::Optics;
use crate::scene::World;
use crate::term::{Pass, Plan, Term};
use phasmid_profile::Profile;
use serde::Serialize;

/// The plan's decision on one term.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// The pass that the term belongs to.
    pub pass: Pass,
    /// The term.
    pub term: Term,
    /// Whether the term is computed.
    pub included: bool,
    /// Reason for the decision.
    pub why: &'static str,
}

/// Inputs that decide whether a term is needed.
pub(super) struct Needs<'a> {
    pub(super) profile: &'a Profile,
    pub(super) optics: &'a Optics,
    pub(super) world: &'a World,
}

impl Plan {
    /// Creates the plan for a profile and a scene, before any pattern is known.
    pub(super) fn new(needs: &Needs<'_>) -> Self {
        let mut plan = Self::default();
        for term in Term::ALL {
            plan.set(term, needs.decide(term).0);
        }
        plan
    }

    /// Returns the decision on every term, in pass order.
    pub(super) fn decisions(&self, needs: &Needs<'_>) -> Vec<Decision> {
        let decision = |term: Term| {
            let (needed, why) = needs.decide(term);
            let included = self.has(term);
            let why = match (needed, included) {
                (false, true) => term.why_added(),
                (true, false) => "left out on request",
                _ => why,
            };
            Decision {
                pass: term.pass(),
                term,
                included,
                why,
            }
        };
        Term::ALL.into_iter().map(decision).collect()
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
                "projector.focus is absent or describes a pinhole",
            ),
            Term::Shadows => choose(
                self.world.casts_shadows(),
                "some surface may shadow another",
                "at most one convex solid, which shades itself only by facing away",
            ),
            Term::DepthOfField => choose(
                self.profile.camera.focus_mm.is_some(),
                "camera.focus_mm is given",
                "camera.focus_mm is absent: everything is in focus",
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
                    "at most one convex solid, which sees no other surface",
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
                "neither projector.timing nor projector.led: patterns appear without delay, in steady light",
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
