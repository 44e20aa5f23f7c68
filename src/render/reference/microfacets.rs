//! A rough surface over a diffuse base, implemented directly from the published formulas.

use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Number of steps in the table of the reflected fraction; its cosines are the squares of
/// equidistant steps.
const STEPS: usize = 64;
/// Number of steps of the integral over facet normals, in slope and in azimuth.
const NORMALS: [usize; 2] = [600, 48];

/// GGX facets with Schlick's Fresnel approximation over a diffuse base.
pub(super) struct Microfacets {
    f0: f64,
    alpha2: f64,
    shares: Vec<f64>,
    mean: f64,
}

impl Microfacets {
    /// Creates the model from the reflectance at normal incidence and the perceptual roughness.
    pub(super) fn new(f0: f64, roughness: f64) -> Self {
        let mut facets = Self {
            f0,
            alpha2: roughness.powi(4),
            shares: Vec::new(),
            mean: 0.0,
        };
        let shares = (0..=STEPS).map(|i| facets.integrate((i as f64 / STEPS as f64).powi(2)));
        facets.shares = shares.collect();
        // Hemispherical mean, which is 2 times the integral of share(c) c dc with c = s^2.
        let n = 4000;
        facets.mean = (0..n)
            .map(|i| (f64::from(i) + 0.5) / f64::from(n))
            .map(|s| 4.0 * facets.share(s * s) * s.powi(3) / f64::from(n))
            .sum();
        facets
    }

    /// Returns pi times the BRDF: the lobe of Walter et al. 2007 (equation 20) with the
    /// height-correlated masking of Heitz 2014 (equation 99), and the diffuse base of Kelemen and
    /// Szirmay-Kalos 2001.
    pub(super) fn reflectance(&self, albedo: f64, normal: DVec3, light: DVec3, view: DVec3) -> f64 {
        let (cl, cv) = (normal.dot(light), normal.dot(view));
        let half = (light + view).normalize();
        let c2 = normal.dot(half).powi(2);
        // Walter et al. 2007, equation 33.
        let d = self.alpha2 / (PI * c2 * c2 * (self.alpha2 + (1.0 - c2) / c2).powi(2));
        let masked = 1.0 / (1.0 + self.lambda(cl) + self.lambda(cv));
        let lobe = d * masked * self.fresnel(view.dot(half)) / (4.0 * cl * cv);
        let body = albedo * (1.0 - self.share(cl)) * (1.0 - self.share(cv)) / (1.0 - self.mean);
        PI * lobe + body
    }

    /// Returns the fraction of light at an incidence cosine that the lobe reflects.
    pub(super) fn share(&self, cos: f64) -> f64 {
        let at = cos.clamp(0.0, 1.0).sqrt() * STEPS as f64;
        let i = (at as usize).min(STEPS - 1);
        let on = at - i as f64;
        (1.0 - on) * self.shares[i] + on * self.shares[i + 1]
    }

    /// Returns the function Lambda of Heitz 2014, equation 72.
    fn lambda(&self, cos: f64) -> f64 {
        let tan2 = (1.0 - cos * cos) / (cos * cos);
        ((1.0 + self.alpha2 * tan2).sqrt() - 1.0) / 2.0
    }

    fn fresnel(&self, cos: f64) -> f64 {
        self.f0 + (1.0 - self.f0) * (1.0 - cos).powi(5)
    }

    /// Integrates the lobe times the cosine over facet normals that are distributed by D (n.h):
    /// Walter et al. 2007, equations 35, 36 and 41.
    fn integrate(&self, cos: f64) -> f64 {
        let cos = cos.max(1e-6);
        let view = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let [slopes, turns] = NORMALS;
        let mut sum = 0.0;
        for i in 0..slopes {
            // The distribution has a long tail of steep facets, so steps shrink towards it.
            let left = (i as f64 + 0.5) / slopes as f64;
            let (u, weight) = (1.0 - left.powi(3), 3.0 * left * left);
            let tan2 = self.alpha2 * u / (1.0 - u);
            let up = 1.0 / (1.0 + tan2).sqrt();
            let aside = (1.0 - up * up).max(0.0).sqrt();
            for j in 0..turns {
                let (sin, cos_turn) = (TAU * (j as f64 + 0.5) / turns as f64).sin_cos();
                let half = DVec3::new(aside * cos_turn, aside * sin, up);
                let met = view.dot(half);
                let light = half * (2.0 * met) - view;
                if met > 0.0 && light.z > 0.0 {
                    let masked = 1.0 / (1.0 + self.lambda(light.z) + self.lambda(cos));
                    sum += weight * self.fresnel(met) * masked * met / (cos * up);
                }
            }
        }
        sum / (slopes * turns) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The model agrees with the closed forms for alpha = 1 and F = 1: D = 1/pi and
    /// lambda(c) = (1/c - 1)/2, so that pi f = 1/(2 (n.l + n.v)), the reflected fraction is
    /// 1 - c ln(1 + 1/c), and its mean is 4/3 (1 - ln 2).
    #[test]
    fn the_roughest_metal_has_a_closed_form() {
        let facets = Microfacets::new(1.0, 1.0);
        for cos in [0.05, 0.2, 0.5, 0.8, 1.0f64] {
            let exact = 1.0 - cos * (1.0 + 1.0 / cos).ln();
            let found = facets.share(cos);
            assert!((found - exact).abs() < 2e-3, "{cos}: {found} {exact}");
        }
        let mean = 4.0 / 3.0 * (1.0 - 2f64.ln());
        assert!((facets.mean - mean).abs() < 2e-3, "{} {mean}", facets.mean);
    }
}
