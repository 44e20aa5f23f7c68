//! Blurred step function: normal distribution function and density, from a table.
//!
//! Nodes are h = 1/32 apart and interpolated by cubic Hermite polynomials, whose error is at most
//! h^4 / 384 max|f''''|, below 1e-8 here.

/// Nodes per standard deviation.
const FINE: f64 = 32.0;
/// Range of the table in standard deviations; the function differs from 0 or 1 by 1e-9 there.
const END: f64 = 6.0;

/// Table of the normal distribution function and density.
#[derive(Debug, Clone)]
pub(super) struct Steps {
    /// Function and density at each node.
    nodes: Vec<[f64; 2]>,
}

impl Steps {
    pub fn new() -> Self {
        let density = |u: f64| (-0.5 * u * u).exp() / std::f64::consts::TAU.sqrt();
        let h = 1.0 / FINE;
        // Phi(-6).
        let mut sum = 9.865_876_45e-10;
        let nodes = (0..=(2.0 * END * FINE) as usize)
            .map(|node| {
                let u = node as f64 * h - END;
                let here = [sum, density(u)];
                // Simpson's rule up to the next node, exact to 1e-12.
                sum += h / 6.0 * (here[1] + 4.0 * density(u + 0.5 * h) + density(u + h));
                here
            })
            .collect();
        Self { nodes }
    }

    /// Returns function and density at `u`.
    pub fn at(&self, u: f64) -> [f64; 2] {
        let place = (u + END) * FINE;
        if !(place > 0.0) {
            return [0.0, 0.0];
        }
        let node = place as usize;
        let Some([[f0, d0], [f1, d1]]) = self.nodes.get(node..node + 2).map(|n| [n[0], n[1]])
        else {
            return [1.0, 0.0];
        };
        let t = place - node as f64;
        let h = 1.0 / FINE;
        let u0 = node as f64 * h - END;
        let cubic = |y0: f64, s0: f64, y1: f64, s1: f64| {
            let rise = y1 - y0;
            y0 + t * (s0 + t * ((3.0 * rise - 2.0 * s0 - s1) + t * (s0 + s1 - 2.0 * rise)))
        };
        // The density's derivative is -u times the density.
        [
            cubic(f0, h * d0, f1, h * d1),
            cubic(d0, -h * u0 * d0, d1, -h * (u0 + h) * d1),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_holds_the_published_values() {
        let steps = Steps::new();
        // Abramowitz and Stegun, table 26.1.
        for (u, f, d) in [
            (0.0, 0.5, 0.398_942_280_401),
            (1.0, 0.841_344_746_069, 0.241_970_724_519),
            (1.96, 0.975_002_104_852, 0.058_440_944_333),
            (3.0, 0.998_650_101_968, 0.004_431_848_412),
        ] {
            let [plus, density] = steps.at(u);
            let [minus, _] = steps.at(-u);
            assert!((plus - f).abs() < 1e-8 && (minus + f - 1.0).abs() < 1e-8);
            assert!((density - d).abs() < 1e-8, "{density} {d}");
        }
        assert_eq!(steps.at(-40.0), [0.0, 0.0]);
        assert_eq!(steps.at(40.0), [1.0, 0.0]);
        assert_eq!(steps.at(f64::NAN), [0.0, 0.0]);
    }
}
