//! The second antiderivative of the normal distribution, and the trapezoid of a footprint convolved
//! with a Gaussian blur.

/// The table covers arguments from -END to END; beyond that the density is below 1e-8.
const END: f64 = 6.0;
/// Number of table intervals per unit of the argument.
const FINE: usize = 16;

/// G with G'' = Phi, the normal distribution, and G = 0 far to the left:
/// G(z) = ((z^2 + 1) Phi(z) + z phi(z)) / 2 is the integral of z Phi(z) + phi(z).
///
/// Tabulated as quintic Hermite pieces with two continuous derivatives, so that second differences
/// are smooth across pieces: G is accurate to 1e-11, its second derivative to 1e-8.
pub(crate) struct Bell {
    pieces: Vec<[f64; 6]>,
}

impl Bell {
    pub(crate) fn new() -> Self {
        let nodes = 2 * END as usize * FINE;
        let h = 1.0 / FINE as f64;
        let node = |i: usize| {
            let z = i as f64 * h - END;
            let (p, d) = (distribution(z), density(z));
            // Value of G, and its derivatives with respect to the fraction of an interval.
            [
                ((z * z + 1.0) * p + z * d) / 2.0,
                (z * p + d) * h,
                p * h * h,
            ]
        };
        let pieces = (0..nodes).map(|i| hermite(node(i), node(i + 1))).collect();
        Self { pieces }
    }

    /// Returns the polynomial coefficients of each piece, starting at -6, with sixteen pieces per
    /// unit.
    pub(crate) fn pieces(&self) -> &[[f64; 6]] {
        &self.pieces
    }

    /// Returns G(z).
    pub(super) fn at(&self, z: f64) -> f64 {
        let place = (z + END) * FINE as f64;
        if place < 0.0 {
            return 0.0;
        }
        let i = place as usize;
        match self.pieces.get(i) {
            Some(c) => {
                let t = place - i as f64;
                c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
            }
            None => (z * z + 1.0) / 2.0,
        }
    }
}

/// Returns the coefficients of the quintic polynomial on [0, 1] with these values, slopes and
/// curvatures at both ends.
fn hermite(a: [f64; 3], b: [f64; 3]) -> [f64; 6] {
    let rise = b[0] - a[0] - a[1] - 0.5 * a[2];
    let slope = b[1] - a[1] - a[2];
    let curve = b[2] - a[2];
    [
        a[0],
        a[1],
        0.5 * a[2],
        10.0 * rise - 4.0 * slope + 0.5 * curve,
        -15.0 * rise + 7.0 * slope - curve,
        6.0 * rise - 3.0 * slope + 0.5 * curve,
    ]
}

pub(crate) fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt()
}

/// Returns Phi(z), computed by its series of positive terms (Abramowitz and Stegun 26.2.11).
pub(crate) fn distribution(z: f64) -> f64 {
    let x = z.abs();
    if x > 9.0 {
        return if z < 0.0 { 0.0 } else { 1.0 };
    }
    let (mut term, mut sum) = (x, x);
    let mut odd = 1.0;
    while term > 1e-18 * sum {
        odd += 2.0;
        term *= x * x / odd;
        sum += term;
    }
    let half = density(x) * sum;
    if z < 0.0 { 0.5 - half } else { 0.5 + half }
}

/// The convolution of two boxes and a Gaussian, along one axis of the pattern image.
#[derive(Clone, Copy)]
pub(crate) struct Soft<'a> {
    bell: &'a Bell,
    sigma: f64,
    wide: f64,
    narrow: f64,
}

impl<'a> Soft<'a> {
    /// Returns the convolution of two boxes of widths |`slope`| and a Gaussian of standard deviation
    /// `sigma` (above 0), all in projector pixels.
    pub(crate) fn new(bell: &'a Bell, slope: [f64; 2], sigma: f64) -> Self {
        let [a, b] = slope.map(f64::abs);
        // Widen boxes that are much narrower than the blur: they have no effect but would cause
        // cancellation.
        let wide = a.max(b).max(1e-3 * sigma);
        let narrow = a.min(b).max(1e-3 * sigma).max(1e-6 * wide).min(wide);
        Self {
            bell,
            sigma,
            wide,
            narrow,
        }
    }

    /// Returns half the base width of the trapezoid without blur.
    pub(super) fn outer(&self) -> f64 {
        (self.wide + self.narrow) / 2.0
    }

    /// Returns the fraction of the blurred trapezoid to the left of a border at distance e from its
    /// centre.
    pub(crate) fn left_of(&self, e: f64) -> f64 {
        let second = self.second_difference(e, |e| self.bell.at(e / self.sigma));
        second * self.sigma * self.sigma
    }

    /// Returns the fraction of the trapezoid without blur to the left of a border at distance e from
    /// its centre.
    pub(crate) fn sharp_left_of(&self, e: f64) -> f64 {
        self.second_difference(e, |e| 0.5 * e.max(0.0).powi(2))
    }

    fn second_difference(&self, e: f64, q: impl Fn(f64) -> f64) -> f64 {
        let (outer, inner) = (self.outer(), (self.wide - self.narrow) / 2.0);
        let second = (q(e + outer) - q(e + inner)) - (q(e - inner) - q(e - outer));
        second / (self.wide * self.narrow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distribution_is_that_of_published_tables() {
        // Abramowitz and Stegun, table 26.1.
        for (z, p) in [
            (0.0, 0.5),
            (1.0, 0.841_344_746_068_543),
            (-2.0, 0.022_750_131_948_179_2),
            (3.0, 0.998_650_101_968_370),
            (5.0, 0.999_999_713_348_428),
        ] {
            assert!((distribution(z) - p).abs() < 1e-14, "{z}");
        }
    }

    #[test]
    fn second_differences_of_the_table_are_the_distribution() {
        let bell = Bell::new();
        for i in -700..700 {
            let z = f64::from(i) * 0.01 + 0.003;
            let exact = ((z * z + 1.0) * distribution(z) + z * density(z)) / 2.0;
            assert!((bell.at(z) - exact).abs() < 1e-10, "{z}");
            let h = 2e-3;
            let second = (bell.at(z + h) - 2.0 * bell.at(z) + bell.at(z - h)) / (h * h);
            assert!((second - distribution(z)).abs() < 1e-6, "{z} {second}");
        }
    }
}
