//! Converts pattern levels to light: response curve and contrast ratio.

use super::super::{Plan, Term};
use phasmid_profile::Projector;

/// Light that the projector emits for each level.
pub(super) struct Curve {
    /// Light relative to full white, one entry for each level; `None` if the light is proportional
    /// to the level.
    light: Option<Vec<f64>>,
    full: f64,
}

impl Curve {
    /// Creates the projector's curve with the response and contrast terms that the plan includes.
    pub(super) fn new(projector: &Projector, plan: &Plan) -> Self {
        let mut projector = projector.clone();
        if !plan.has(Term::ProjectorResponse) {
            projector.response = None;
        }
        if !plan.has(Term::ContrastRatio) {
            projector.contrast_ratio = None;
        }
        let full = (1u16 << projector.bits) - 1;
        let light: Vec<f64> = (0..=full).map(|level| projector.light(level)).collect();
        let full = f64::from(full);
        let straight = |(level, &light): (usize, &f64)| light == level as f64 / full;
        let bent = !light.iter().enumerate().all(straight);
        Self {
            light: bent.then_some(light),
            full,
        }
    }

    /// Returns the light of one level, relative to full white.
    pub(super) fn light(&self, level: u16) -> f64 {
        match &self.light {
            Some(light) => light[usize::from(level)],
            None => f64::from(level) / self.full,
        }
    }

    /// Returns integers proportional to the light of `levels`, and the light per unit of these
    /// integers. The integers are the levels themselves or, if the response is non-linear, 16-bit
    /// values (accurate to 1/500 of a grey level of 255).
    pub(super) fn integers(&self, levels: &[u16]) -> (Vec<u16>, f32) {
        match &self.light {
            Some(light) => {
                let table: Vec<u16> = light
                    .iter()
                    .map(|light| (light * 65535.0).round() as u16)
                    .collect();
                let fine = levels.iter().map(|&l| table[usize::from(l)]).collect();
                (fine, 1.0 / 65535.0)
            }
            None => (levels.to_vec(), 1.0 / self.full as f32),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::Profile;

    #[test]
    fn integers_stand_for_the_light_within_a_hundredth_of_a_grey_level() {
        let mut projector = Profile::load("pmp-bench").unwrap().projector;
        projector.response = Some(phasmid_profile::Response::Gamma(2.2));
        projector.contrast_ratio = Some(1500.0);
        let mut plan = Plan::default();
        plan.set(Term::ProjectorResponse, true);
        plan.set(Term::ContrastRatio, true);
        let curve = Curve::new(&projector, &plan);
        let levels: Vec<u16> = (0..256).collect();
        let (integers, scale) = curve.integers(&levels);
        for (level, &integer) in integers.iter().enumerate() {
            // The formulas of response curve and contrast ratio, written out.
            let power = (level as f64 / 255.0).powf(2.2);
            let light = 1.0 / 1500.0 + (1.0 - 1.0 / 1500.0) * power;
            let error = f64::from(f32::from(integer) * scale) - light;
            assert!(error.abs() * 255.0 < 0.01, "{level} {error}");
        }
        assert_eq!((integers[255], curve.light(255)), (65535, 1.0));
    }

    #[test]
    fn a_neutral_curve_leaves_the_levels_alone() {
        let mut projector = Profile::load("pmp-bench").unwrap().projector;
        projector.response = Some(phasmid_profile::Response::Table(vec![0.0, 1.0]));
        let mut plan = Plan::default();
        plan.set(Term::ProjectorResponse, true);
        plan.set(Term::ContrastRatio, true);
        for response in [None, Some(phasmid_profile::Response::Gamma(1.0))] {
            projector.response = response;
            let levels: Vec<u16> = (0..256).collect();
            let (integers, scale) = Curve::new(&projector, &plan).integers(&levels);
            assert_eq!((integers, scale), (levels, 1.0 / 255.0));
        }
    }
}
