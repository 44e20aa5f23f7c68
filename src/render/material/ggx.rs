//! A rough dielectric or metal over a diffuse base: the GGX microfacet model.
//!
//! The specular lobe is f_s = D G2 F / (4 (n.l)(n.v)), with D of Walter et al. ("Microfacet Models
//! for Refraction through Rough Surfaces", EGSR 2007, equation 33), G2 the height-correlated Smith
//! term (Heitz, "Understanding the Masking-Shadowing Function", JCGT 3(2), 2014, equation 99), and F
//! by Schlick (1994). Only single scattering between facets is modelled. Light that facets would
//! scatter more than once is lost: 59 % of uniform light on the roughest metal, almost nothing below
//! a roughness of 0.4.
//!
//! Light that the lobe does not reflect enters the diffuse base. With E(c) the fraction that the
//! lobe reflects of light at cosine c, the diffuse part is
//! albedo (1 - E(n.l)) (1 - E(n.v)) / (pi (1 - mean E)). This is symmetric, and lobe and base together reflect E(n.v) + albedo (1 - E(n.v)),
//! which is never more than the incident light (Kelemen and Szirmay-Kalos, "A Microfacet Based
//! Coupled Specular-Matte BRDF Model", Eurographics 2001).

use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Number of intervals in the table of E. They are evenly spaced in the square root of the cosine,
/// because E is steep at grazing angles.
const PIECES: usize = 128;
/// Number of samples along a side of the grid by which a table value is integrated.
const GRID: usize = 48;
/// Minimum cosine of the angle to the camera, used where an interpolated normal faces away from the
/// camera.
const GRAZING: f64 = 1e-4;

/// A material with a specular lobe.
#[derive(Debug, Clone)]
pub(crate) struct Ggx {
    pub(crate) f0: f64,
    pub(crate) alpha: f64,
    /// Values of E at the cosines (i / PIECES)^2.
    pub(crate) reflected: Vec<f64>,
    /// Inverse of 1 - mean E; 0 if no light enters the base.
    pub(crate) coupling: f64,
}

impl Ggx {
    /// Creates the material from its reflectance at normal incidence and its perceptual roughness,
    /// whose square is alpha.
    pub(crate) fn new(f0: f64, roughness: f64) -> Self {
        let mut ggx = Self {
            f0,
            alpha: roughness * roughness,
            reflected: Vec::new(),
            coupling: 0.0,
        };
        let at = |i: usize| ggx.integrate((i as f64 / PIECES as f64).powi(2));
        // At an exactly grazing direction the surface acts as a mirror.
        ggx.reflected = (0..=PIECES).into_par_iter().map(at).collect();
        let entered = 1.0 - ggx.mean();
        if entered > 1e-9 {
            ggx.coupling = 1.0 / entered;
        }
        ggx
    }

    /// Returns pi times the BRDF for a diffuse albedo of `albedo`: the reflectance for light from
    /// one direction, relative to a white Lambertian surface. `normal`, `light` and `view` are unit
    /// vectors that point away from the surface; the result is 0 for light from behind the surface.
    pub(crate) fn reflectance(&self, albedo: f64, normal: DVec3, light: DVec3, view: DVec3) -> f64 {
        let cos_light = normal.dot(light);
        if !(cos_light > 0.0) {
            return 0.0;
        }
        let cos_view = normal.dot(view).max(GRAZING);
        let diffuse =
            albedo * (1.0 - self.albedo(cos_light)) * (1.0 - self.albedo(cos_view)) * self.coupling;
        diffuse + self.lobe(normal, light, view, cos_light, cos_view)
    }

    /// Returns the reflectance towards the viewer under uniform light. By reciprocity it equals the
    /// total reflectance for light from the viewer's direction.
    pub(crate) fn under_even_light(&self, albedo: f64, cos_view: f64) -> f64 {
        let specular = self.albedo(cos_view.max(GRAZING));
        specular + albedo * (1.0 - specular)
    }

    /// Returns pi times the specular lobe f_s.
    fn lobe(&self, n: DVec3, l: DVec3, v: DVec3, cos_light: f64, cos_view: f64) -> f64 {
        let Some(half) = (l + v).try_normalize() else {
            return 0.0;
        };
        let a2 = self.alpha * self.alpha;
        let cos = n.dot(half);
        // 1 - cos^2 is computed by a cross product, because it is far smaller than 1 in the
        // highlight of a smooth surface.
        let spread = a2 * cos * cos + n.cross(half).length_squared();
        // pi D, and G2 / (4 cos cos), which is finite at every angle.
        let d = a2 / (spread * spread);
        let smith = |a: f64, b: f64| a * (a2 + (1.0 - a2) * b * b).sqrt();
        let visible = 0.5 / (smith(cos_light, cos_view) + smith(cos_view, cos_light));
        d * visible * self.fresnel(v.dot(half))
    }

    fn fresnel(&self, cos: f64) -> f64 {
        self.f0 + (1.0 - self.f0) * (1.0 - cos.clamp(0.0, 1.0)).powi(5)
    }

    /// Returns E, the fraction of light at a cosine that the lobe reflects.
    fn albedo(&self, cos: f64) -> f64 {
        let at = cos.clamp(0.0, 1.0).sqrt() * PIECES as f64;
        let i = (at as usize).min(PIECES - 1);
        self.reflected[i] + (at - i as f64) * (self.reflected[i + 1] - self.reflected[i])
    }

    /// Computes E by integration over the distribution of visible normals; each normal reflects F G2
    /// / G1 of its light (Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4),
    /// 2018).
    fn integrate(&self, cos_view: f64) -> f64 {
        let cos = cos_view.max(GRAZING * GRAZING);
        let view = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        let a = self.alpha;
        let stretched = DVec3::new(a * view.x, 0.0, view.z).normalize();
        // (-y, x, 0) of the stretched view; from straight above any direction is valid.
        let across = DVec3::Y;
        let along = stretched.cross(across);
        let lambda = |c: f64| 0.5 * ((1.0 + a * a * (1.0 - c * c) / (c * c)).sqrt() - 1.0);
        let own = lambda(cos);
        let sample = |i: usize| {
            let (inward, turn) = (
                ((i % GRID) as f64 + 0.5) / GRID as f64,
                ((i / GRID) as f64 + 0.5) / GRID as f64,
            );
            // The samples are dense near the rim of the disc, because GGX has a long tail there.
            let weight = 3.0 * inward * inward;
            let (r, phi) = ((1.0 - inward.powi(3)).sqrt(), 2.0 * PI * turn);
            let (t1, raw) = (r * phi.cos(), r * phi.sin());
            let s = 0.5 * (1.0 + stretched.z);
            let t2 = (1.0 - s) * (1.0 - t1 * t1).max(0.0).sqrt() + s * raw;
            let up = (1.0 - t1 * t1 - t2 * t2).max(0.0).sqrt();
            let h = across * t1 + along * t2 + stretched * up;
            let h = DVec3::new(a * h.x, a * h.y, h.z.max(0.0)).normalize();
            let light = h * (2.0 * view.dot(h)) - view;
            if light.z <= 0.0 {
                return 0.0;
            }
            weight * self.fresnel(view.dot(h)) * (1.0 + own) / (1.0 + own + lambda(light.z))
        };
        let n = GRID * GRID;
        // Normalises the sum of weights, which is slightly different from n.
        let whole = 1.0 - 0.25 / (GRID * GRID) as f64;
        (0..n).map(sample).sum::<f64>() / (n as f64 * whole)
    }

    /// Returns the mean of E over uniform light, which is 2 times the integral of E(c) c dc. It is
    /// exact for the table: with c = s^2 the integrand is a polynomial of degree four on each piece
    /// (three-point Gauss-Legendre).
    fn mean(&self) -> f64 {
        let step = 1.0 / PIECES as f64;
        let nodes = [(-0.6f64.sqrt(), 5.0), (0.0, 8.0), (0.6f64.sqrt(), 5.0)];
        let piece = |i: usize| -> f64 {
            nodes
                .iter()
                .map(|(x, weight)| {
                    let s = (i as f64 + 0.5 + x / 2.0) * step;
                    weight / 18.0 * 4.0 * s.powi(3) * self.albedo(s * s)
                })
                .sum()
        };
        (0..PIECES).map(piece).sum::<f64>() * step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MATERIALS: [(f64, f64); 6] = [
        (0.04, 0.1),
        (0.04, 0.5),
        (0.04, 1.0),
        (1.0, 0.2),
        (1.0, 1.0),
        (0.3, 0.35),
    ];

    fn direction(cos: f64, azimuth: f64) -> DVec3 {
        let sin = (1.0 - cos * cos).sqrt();
        DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
    }

    /// Returns the reflectance towards `view` of uniform light, by the midpoint rule over half
    /// vectors of the upper hemisphere: dl = 4 (v.h) dh. The grid is fine where the lobe is narrow.
    fn quadrature(ggx: &Ggx, albedo: f64, view: DVec3) -> f64 {
        let (n, m) = (1200, 400);
        let mut sum = 0.0;
        for i in 0..n {
            // Polar angle of the half vector, whose spacing becomes finer towards the pole.
            let (low, high) = (i as f64 / n as f64, (i + 1) as f64 / n as f64);
            let theta = |s: f64| s * s * PI / 2.0;
            let solid = theta(low).cos() - theta(high).cos();
            let middle = theta((low + high) / 2.0);
            for j in 0..m {
                let azimuth = 2.0 * PI * (j as f64 + 0.5) / m as f64;
                let h = direction(middle.cos(), azimuth);
                let vh = view.dot(h);
                let light = h * (2.0 * vh) - view;
                if vh <= 0.0 || light.z <= 0.0 {
                    continue;
                }
                let f = ggx.reflectance(albedo, DVec3::Z, light.normalize(), view);
                sum += f / PI * light.z * 4.0 * vh * solid * 2.0 * PI / m as f64;
            }
        }
        sum
    }

    #[test]
    fn furnace_test_conserves_energy() {
        for (f0, roughness) in MATERIALS {
            let ggx = Ggx::new(f0, roughness);
            for cos in [0.08, 0.3, 0.7, 0.98] {
                let view = direction(cos, 0.4);
                for albedo in [0.0, 0.5, 1.0] {
                    let direct = quadrature(&ggx, albedo, view);
                    let table = ggx.under_even_light(albedo, cos);
                    assert!(
                        (direct - table).abs() < 2e-3,
                        "f0 {f0} roughness {roughness} cos {cos} albedo {albedo}: \
                         {direct} by quadrature, {table} by the table"
                    );
                    assert!(table <= 1.0 + 1e-12 && direct < 1.0 + 2e-3);
                    if albedo == 1.0 {
                        assert!((table - 1.0).abs() < 1e-12, "nothing absorbs");
                    }
                }
            }
        }
    }

    #[test]
    fn reflectance_is_reciprocal() {
        for (f0, roughness) in MATERIALS {
            let ggx = Ggx::new(f0, roughness);
            for (a, b, azimuth) in [(0.9, 0.3, 2.0), (0.05, 0.6, 3.1), (0.5, 0.51, 0.2)] {
                let (l, v) = (direction(a, 0.0), direction(b, azimuth));
                let there = ggx.reflectance(0.7, DVec3::Z, l, v);
                let back = ggx.reflectance(0.7, DVec3::Z, v, l);
                assert!(
                    (there - back).abs() < 1e-12 * there.max(1.0),
                    "{there} {back}"
                );
            }
        }
    }

    #[test]
    fn roughest_metal_matches_closed_form() {
        // For alpha = 1 and F = 1, D = 1/pi and Lambda(c) = (1/c - 1)/2, so pi f_s = 1/(2 (n.l +
        // n.v)), E(c) = 1 - c ln(1 + 1/c), and the mean of E is 4/3 (1 - ln 2).
        let ggx = Ggx::new(1.0, 1.0);
        for cos in [0.05, 0.2, 0.5, 0.8, 1.0f64] {
            let exact = 1.0 - cos * (1.0 + 1.0 / cos).ln();
            let found = ggx.under_even_light(0.0, cos);
            assert!((found - exact).abs() < 1e-3, "{cos}: {found} {exact}");
        }
        let mean = 4.0 / 3.0 * (1.0 - 2f64.ln());
        assert!((ggx.mean() - mean).abs() < 1e-3, "{} {mean}", ggx.mean());
        let at = ggx.lobe(DVec3::Z, direction(0.4, 1.0), direction(0.7, 0.0), 0.4, 0.7);
        assert!((at - 1.0 / (2.0 * 1.1)).abs() < 1e-12, "{at}");
    }

    #[test]
    fn reflectance_is_finite_at_any_angle() {
        for (f0, roughness) in [(0.0, 0.05), (1.0, 0.05), (0.04, 1.0)] {
            let ggx = Ggx::new(f0, roughness);
            for (l, v) in [
                (DVec3::Z, DVec3::Z),
                (DVec3::X, DVec3::X),
                (DVec3::X, DVec3::NEG_X),
                (direction(1e-12, 0.0), direction(1e-12, PI)),
                (direction(0.5, 0.0), direction(0.5, PI)),
                (DVec3::NEG_Z, DVec3::Z),
            ] {
                let value = ggx.reflectance(0.5, DVec3::Z, l, v);
                assert!(value.is_finite() && value >= 0.0, "{l} {v}: {value}");
            }
        }
    }
}
