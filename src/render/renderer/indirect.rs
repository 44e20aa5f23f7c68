//! Choice of the settings with which indirect light is gathered, and the error that they cause.

use super::Renderer;
use crate::Term;
use crate::exposure::{Gathering, GeometryBuffer};
use crate::transport::interreflection::Trial;
use serde::Serialize;

/// Settings of interreflection with their errors, in percent of a pixel's light under full white.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IndirectLight {
    /// Number of rays per gather point.
    pub samples: u32,
    /// Spacing of the gather points in pixels.
    pub step_px: u32,
    /// 99th percentile of the error over the pixels that the projector lights.
    pub error_percent: f64,
    /// Bound on the error that the scene states; `None` if the scene states the settings instead.
    pub bound_percent: Option<f64>,
    /// Median, over the pixels that the projector lights, of the light of further bounces, which are
    /// not rendered.
    pub further_percent: f64,
    /// 95th percentile, over the same pixels, of the light of further bounces.
    pub most_further_percent: f64,
}

impl Renderer {
    /// Estimates the error of the indirect light, and the light that further bounces would add, at a
    /// sample of pixels; `None` for a scene without interreflection.
    pub fn indirect_light(&mut self) -> Option<IndirectLight> {
        let gathering = self.optics.interreflection?;
        let wanted = self.scene.interreflection?;
        self.with_trial(|trial| {
            let [median, most] = trial.further();
            IndirectLight {
                samples: gathering.samples,
                step_px: gathering.step_px,
                error_percent: 100.0 * trial.error(gathering),
                bound_percent: wanted.samples.is_none().then_some(wanted.error_percent),
                further_percent: 100.0 * median,
                most_further_percent: 100.0 * most,
            }
        })
    }

    /// Chooses the number of rays and the spacing of gather points so that the error is within the
    /// scene's bound, unless the scene states both.
    pub(super) fn choose_gathering(&mut self) {
        let wanted = self.scene.interreflection;
        let Some(wanted) = wanted.filter(|wanted| wanted.samples.is_none()) else {
            return;
        };
        let chosen = self.with_trial(|trial| trial.choose(0.01 * wanted.error_percent));
        self.optics.interreflection = chosen.or(self.optics.interreflection);
    }

    /// Runs a trial of gathering on the current scene, on the CPU; `None` without interreflection.
    fn with_trial<R>(&mut self, run: impl FnOnce(&Trial<'_>) -> R) -> Option<R> {
        if !self.plan.has(Term::Interreflection) {
            return None;
        }
        let gathering: Option<Gathering> = self.optics.interreflection.take();
        let mut buffer = GeometryBuffer::default();
        self.trace(&mut buffer);
        let rays = self.pixel_rays();
        let result = run(&Trial::new(&self.worlds, &rays, &self.plan, &buffer));
        self.optics.interreflection = gathering;
        Some(result)
    }
}
