//! Profile of a straight edge under blur, integrated over square pixels.
//!
//! F(t) is the share of a pixel on the edge's positive side if the pixel's centre is at signed
//! distance t from the edge. It is the distribution function of (a box of width |nx|) + (a box of
//! width |ny|) + (the Gaussian of the blur), n being the edge's unit normal. With H the second
//! integral of the normal distribution function, F is a second difference of H:
//!
//! ```text
//! F(t) = [H(t + (a + b) / 2) - H(t + (a - b) / 2) - H(t - (a - b) / 2) + H(t - (a + b) / 2)] / (a b)
//! H(t) = ((t^2 + s^2) Phi(t / s) + t s phi(t / s)) / 2,   a = |nx|, b = |ny|
//! ```
//!
//! This is exact for any direction and any blur, including none.

use std::f64::consts::PI;
use std::sync::LazyLock;

/// A box with a width below this, in pixels, is replaced by a Gaussian of the same variance.
const NARROW: f64 = 0.03;
/// Minimum standard deviation of the blur in pixels; smaller values would not change the profile
/// noticeably.
const LEAST: f64 = 1e-3;

/// The function F of the module's documentation for one edge direction and one blur.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    wide: f64,
    narrow: f64,
    sigma: f64,
    reach: f64,
}

/// Share of a pixel that lies on the edge's positive side, and the derivatives of that share with
/// respect to the distance and the blur's variance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share {
    pub(super) share: f64,
    pub(super) by_distance: f64,
    pub(super) by_variance: f64,
}

impl Edge {
    /// Creates the profile of an edge with unit normal (`nx`, `ny`) under Gaussian blur of this
    /// variance in pixels squared.
    pub(super) fn new(nx: f64, ny: f64, variance: f64) -> Self {
        let (wide, mut narrow) = (nx.abs().max(ny.abs()), nx.abs().min(ny.abs()));
        let mut variance = variance;
        if narrow < NARROW {
            variance += narrow * narrow / 12.0;
            narrow = 0.0;
        }
        let sigma = variance.max(LEAST * LEAST).sqrt();
        Self {
            wide,
            narrow,
            sigma,
            reach: 0.5 * (wide + narrow) + 6.0 * sigma,
        }
    }

    /// Evaluates the profile at a signed distance in pixels from the edge.
    pub(super) fn at(&self, t: f64) -> Share {
        if t.abs() > self.reach {
            return Share {
                share: if t > 0.0 { 1.0 } else { 0.0 },
                by_distance: 0.0,
                by_variance: 0.0,
            };
        }
        let (a, b, s) = (self.wide, self.narrow, self.sigma);
        // Phi's second and first integral, Phi, and phi.
        let terms = |t: f64| {
            let (cdf, pdf) = normal(t / s);
            let first = t * cdf + s * pdf;
            (0.5 * (t * first + s * s * cdf), first, cdf, pdf / s)
        };
        if b == 0.0 {
            let (high, low) = (terms(t + 0.5 * a), terms(t - 0.5 * a));
            return Share {
                share: (high.1 - low.1) / a,
                by_distance: (high.2 - low.2) / a,
                by_variance: 0.5 * (high.3 - low.3) / a,
            };
        }
        let (outer, inner) = (0.5 * (a + b), 0.5 * (a - b));
        let (p, q) = (terms(t + outer), terms(t + inner));
        let (r, u) = (terms(t - inner), terms(t - outer));
        let area = a * b;
        Share {
            share: (p.0 - q.0 - r.0 + u.0) / area,
            by_distance: (p.1 - q.1 - r.1 + u.1) / area,
            by_variance: 0.5 * (p.2 - q.2 - r.2 + u.2) / area,
        }
    }
}

/// Table steps per standard deviation, and end of the table in standard deviations.
const STEPS: usize = 64;
const END: usize = 8;

/// Normal distribution function and density at 0, 1 / STEPS, 2 / STEPS and so on.
static TABLE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| {
    let at = |i: usize| exact(i as f64 / STEPS as f64);
    (0..=STEPS * END + 1).map(at).collect()
});

/// Normal distribution function and density, to 1e-9: cubic Hermite interpolation of a table.
pub(super) fn normal(x: f64) -> (f64, f64) {
    let scaled = x.abs() * STEPS as f64;
    if scaled >= (STEPS * END) as f64 {
        return (if x > 0.0 { 1.0 } else { 0.0 }, 0.0);
    }
    let i = scaled as usize;
    let t = scaled - i as f64;
    let (h, at) = (1.0 / STEPS as f64, i as f64 / STEPS as f64);
    let ((p0, d0), (p1, d1)) = (TABLE[i], TABLE[i + 1]);
    let hermite = |p0: f64, m0: f64, p1: f64, m1: f64| {
        let rise = p1 - p0;
        p0 + t * (m0 + t * (3.0 * rise - 2.0 * m0 - m1 + t * (m0 + m1 - 2.0 * rise)))
    };
    let cdf = hermite(p0, h * d0, p1, h * d1);
    let pdf = hermite(d0, -h * at * d0, d1, -h * (at + h) * d1);
    (if x > 0.0 { cdf } else { 1.0 - cdf }, pdf)
}

/// Normal distribution function and density for x >= 0: a Taylor series below 3 (Abramowitz and
/// Stegun, 26.2.11), a continued fraction above (26.2.14).
fn exact(x: f64) -> (f64, f64) {
    let pdf = (-0.5 * x * x).exp() / (2.0 * PI).sqrt();
    if x < 3.0 {
        let (mut term, mut sum) = (x, x);
        for n in 1..60 {
            term *= x * x / f64::from(2 * n + 1);
            sum += term;
        }
        return (0.5 + pdf * sum, pdf);
    }
    let mut tail = x;
    for n in (1..=40).rev() {
        tail = x + f64::from(n) / tail;
    }
    (1.0 - pdf / tail, pdf)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_1_SQRT_2;

    #[test]
    fn normal_distribution_matches_published_table() {
        // Abramowitz and Stegun, table 26.1.
        for (x, p) in [
            (0.0, 0.5),
            (1.0, 0.841_344_746_068_543),
            (2.5, 0.993_790_334_674_224),
            (3.0, 0.998_650_101_968_370),
            (-4.0, 3.167_124_183_3e-5),
        ] {
            assert!((normal(x).0 - p).abs() < 1e-13, "{x} {}", normal(x).0);
        }
        for i in 0..4000 {
            let x = f64::from(i) * 0.002_1;
            let (p, q) = (normal(x), exact(x));
            assert!((p.0 - q.0).abs() < 1e-9 && (p.1 - q.1).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn shares_are_sums_over_the_pixels_area() {
        for (angle, blur) in [
            (0.0, 0.4),
            (0.01, 0.3),
            (0.5, 0.2),
            (PI / 4.0, 1.0),
            (1.2, 2.0),
        ] {
            let (ny, nx) = f64::sin_cos(angle);
            let edge = Edge::new(nx, ny, blur * blur);
            for t in [-1.3, -0.4, 0.0, 0.2, 0.9] {
                let n = 200;
                let place = |i: i32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
                let mut sum = 0.0;
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    sum += normal((t + nx * place(i) + ny * place(j)) / blur).0;
                }
                let (truth, found) = (sum / f64::from(n * n), edge.at(t));
                assert!((truth - found.share).abs() < 2e-5, "{angle} {blur} {t}");
                let h = 1e-4;
                let slope = (edge.at(t + h).share - edge.at(t - h).share) / (2.0 * h);
                assert!((slope - found.by_distance).abs() < 1e-5);
                let wider = Edge::new(nx, ny, blur * blur + h).at(t).share;
                let slope = (wider - Edge::new(nx, ny, blur * blur - h).at(t).share) / (2.0 * h);
                assert!((slope - found.by_variance).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn share_without_blur_equals_area() {
        let edge = Edge::new(1.0, 0.0, 0.0);
        for (t, share) in [
            (-0.6, 0.0),
            (-0.25, 0.25),
            (0.0, 0.5),
            (0.4, 0.9),
            (0.7, 1.0),
        ] {
            assert!((edge.at(t).share - share).abs() < 1e-6, "{t}");
        }
        // A diagonal edge cuts off a triangle of area (sqrt(1/2) - t)^2.
        let edge = Edge::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0);
        assert!((edge.at(0.3).share - 1.0 + (FRAC_1_SQRT_2 - 0.3_f64).powi(2)).abs() < 1e-5);
    }
}
