//! Joint covariance of a calibration's parameters.
//!
//! It is kept and written as its lower triangular factor F, C = F F': F can be rounded, while a
//! nearly singular C with rounded entries may no longer be positive definite.

use super::parameters::{PARAMETERS, RIG};
use nalgebra::{Cholesky, DMatrix};
use serde::{Deserialize, Serialize};

/// Joint covariance of a rig's parameters (see [`PARAMETERS`] for their order and units).
/// Parameters that the calibration did not estimate have variance 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "CovarianceTable", into = "CovarianceTable")]
pub struct Covariance {
    estimated: [bool; RIG],
    /// Lower triangular; rows and columns of parameters that were not estimated are 0.
    factor: [[f64; RIG]; RIG],
}

/// Number of significant digits kept of each entry of the factor.
const DIGITS: usize = 8;

impl Covariance {
    /// Creates a covariance from its matrix, with a row and a column for each estimated parameter.
    /// Returns `None` if the matrix has another size or is not positive definite, or if no parameter
    /// is estimated.
    #[doc(hidden)]
    pub fn new(estimated: &[bool; RIG], matrix: &DMatrix<f64>) -> Option<Self> {
        let at = indices(estimated);
        if at.is_empty() || matrix.shape() != (at.len(), at.len()) {
            return None;
        }
        // Scale to unit variances, because the units differ by orders of magnitude.
        let sigma: Vec<f64> = matrix.diagonal().iter().map(|v| v.sqrt()).collect();
        let scaled = DMatrix::from_fn(at.len(), at.len(), |i, j| {
            matrix[(i, j)] / (sigma[i] * sigma[j])
        });
        let scaled = Cholesky::new(scaled)?.l();
        let mut factor = [[0.0; RIG]; RIG];
        for (i, row) in at.iter().enumerate() {
            for (j, column) in at[..=i].iter().enumerate() {
                factor[*row][*column] = rounded(sigma[i] * scaled[(i, j)]);
            }
        }
        let finite = factor.iter().flatten().all(|f| f.is_finite());
        finite.then_some(Self {
            estimated: *estimated,
            factor,
        })
    }

    /// Which parameters the calibration estimated.
    pub fn estimated(&self) -> &[bool; RIG] {
        &self.estimated
    }

    /// Returns the covariance of two parameters, in the product of their units.
    pub fn of(&self, i: usize, j: usize) -> f64 {
        let pairs = self.factor[i].iter().zip(&self.factor[j]);
        pairs.map(|(a, b)| a * b).sum()
    }

    /// Returns a step of the parameters: F times the given numbers. If the numbers are independent and
    /// standard normal, the step has this covariance. Apply the steps of all unit vectors: to first
    /// order, the squares of the changes that they cause in a quantity add up to its variance.
    pub fn step(&self, numbers: &[f64; RIG]) -> [f64; RIG] {
        self.factor
            .map(|row| row.iter().zip(numbers).map(|(f, x)| f * x).sum())
    }

    /// Returns the step of each unit vector of an estimated parameter; see [`Self::step`].
    pub fn steps(&self) -> impl Iterator<Item = [f64; RIG]> {
        indices(&self.estimated)
            .into_iter()
            .map(|column| self.factor.map(|row| row[column]))
    }

    /// Returns the squared Mahalanobis distance of a step of the parameters, and its degrees of
    /// freedom: the number of estimated parameters. For errors of this covariance the distance
    /// follows a chi-square distribution. Parameters that were not estimated are not compared.
    pub fn square(&self, step: &[f64; RIG]) -> (f64, usize) {
        let at = indices(&self.estimated);
        let mut numbers: Vec<f64> = Vec::with_capacity(at.len());
        for row in &at {
            let before: f64 = at
                .iter()
                .zip(&numbers)
                .map(|(column, x)| self.factor[*row][*column] * x)
                .sum();
            numbers.push((step[*row] - before) / self.factor[*row][*row]);
        }
        (numbers.iter().map(|x| x * x).sum(), at.len())
    }
}

fn indices(estimated: &[bool; RIG]) -> Vec<usize> {
    (0..RIG).filter(|i| estimated[*i]).collect()
}

fn rounded(value: f64) -> f64 {
    let text = format!("{value:.0$e}", DIGITS - 1);
    text.parse().expect("a number as it was written")
}

/// Joint covariance C of a calibration's parameters, as C = F F'.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CovarianceTable {
    /// Names of the estimated parameters, such as `camera.fx`, in the order of lenses (fx fy cx cy k1
    /// k2 p1 p2 k3), then the projector's rotation (`turn_x`, in radians, about the axes of the
    /// camera's frame) and translation (`x`, in mm). The others have no error.
    parameters: Vec<String>,
    /// Rows of F, lower triangular, each up to its diagonal.
    factor: Vec<Vec<f64>>,
}

impl From<Covariance> for CovarianceTable {
    fn from(covariance: Covariance) -> Self {
        let at = indices(&covariance.estimated);
        let row = |i: usize| at[..=i].iter().map(move |&j| (i, j));
        Self {
            parameters: at.iter().map(|&i| PARAMETERS[i].0.to_owned()).collect(),
            factor: (0..at.len())
                .map(|i| row(i).map(|(i, j)| covariance.factor[at[i]][j]).collect())
                .collect(),
        }
    }
}

impl TryFrom<CovarianceTable> for Covariance {
    type Error = String;

    fn try_from(written: CovarianceTable) -> Result<Self, String> {
        let CovarianceTable { parameters, factor } = written;
        let mut at = Vec::new();
        for name in &parameters {
            let index = PARAMETERS.iter().position(|(known, _)| known == name);
            let next = at.last().map_or(0, |last| last + 1);
            let Some(index) = index.filter(|i| *i >= next) else {
                let names = PARAMETERS.map(|(name, _)| name).join(", ");
                return Err(format!(
                    "parameters: {name:?}; expected, in this order, some of {names}"
                ));
            };
            at.push(index);
        }
        if at.is_empty() {
            return Err("parameters: an empty list; expected at least one parameter".to_owned());
        }
        if factor.len() != at.len() {
            return Err(format!(
                "factor: {} rows; expected {}",
                factor.len(),
                at.len()
            ));
        }
        let mut covariance = Self {
            estimated: [false; RIG],
            factor: [[0.0; RIG]; RIG],
        };
        for (i, row) in factor.iter().enumerate() {
            if row.len() != i + 1 {
                let (found, wanted) = (row.len(), i + 1);
                return Err(format!(
                    "factor: {found} numbers in row {i}; expected {wanted}"
                ));
            }
            if !(row.iter().all(|f| f.is_finite()) && row[i] > 0.0) {
                return Err(format!(
                    "factor: row {i} is {row:?}; expected finite numbers, the last above 0"
                ));
            }
            covariance.estimated[at[i]] = true;
            for (j, value) in row.iter().enumerate() {
                covariance.factor[at[i]][at[j]] = *value;
            }
        }
        Ok(covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Rig, nominal};

    /// A covariance of three parameters of very different size, nearly singular.
    fn covariance() -> Covariance {
        let mut estimated = [false; RIG];
        let at = [0, 4, 20];
        for i in at {
            estimated[i] = true;
        }
        let factor = [[3.0, 0.0, 0.0], [-2e-5, 1e-9, 0.0], [1e-4, 3e-5, 2e-8]];
        let matrix = DMatrix::from_fn(3, 3, |i, j| {
            (0..3).map(|k| factor[i][k] * factor[j][k]).sum()
        });
        Covariance::new(&estimated, &matrix).unwrap()
    }

    #[test]
    fn a_covariance_is_written_as_it_was_read() {
        let rig = Rig {
            covariance: Some(covariance()),
            ..nominal::rig("pmp-bench")
        };
        let text = rig.to_toml();
        assert_eq!(Rig::from_toml(&text, "c.toml").unwrap(), rig, "{text}");
        for (from, to, needle) in [
            (
                "\"camera.k1\"",
                "\"camera.k9\"",
                "\"camera.k9\"; expected, in this order",
            ),
            (
                "\"camera.k1\"",
                "\"camera.fx\"",
                "\"camera.fx\"; expected, in this order",
            ),
            (
                "factor = [[",
                "factor = [[1.0, ",
                "2 numbers in row 0; expected 1",
            ),
            (
                "factor = [[",
                "factor = [[-",
                "expected finite numbers, the last above 0",
            ),
            ("factor = [", "factor = [[1.0], ", "4 rows; expected 3"),
            ("\nfactor", "\nroot = 1\nfactor", "unknown field `root`"),
        ] {
            let broken = text.replacen(from, to, 1);
            assert_ne!(broken, text, "{from}");
            let message = Rig::from_toml(&broken, "c.toml").unwrap_err().to_string();
            assert!(message.contains(needle), "{message}");
            assert!(message.contains("c.toml:"), "{message}");
        }
    }

    #[test]
    fn steps_have_the_covariance() {
        let c = covariance();
        for i in 0..RIG {
            for j in 0..RIG {
                let sum: f64 = c.steps().map(|step| step[i] * step[j]).sum();
                assert!((sum - c.of(i, j)).abs() <= 1e-12 * (c.of(i, i) * c.of(j, j)).sqrt());
            }
        }
        for step in c.steps() {
            let (square, dof) = c.square(&step);
            assert!((square - 1.0).abs() < 1e-6 && dof == 3, "{square}");
        }
    }

    #[test]
    fn a_matrix_that_is_no_covariance_is_refused() {
        let mut estimated = [false; RIG];
        estimated[..2].fill(true);
        for bad in [[1.0, 2.0, 2.0, 1.0], [-1.0, 0.0, 0.0, 1.0], [f64::NAN; 4]] {
            assert_eq!(
                Covariance::new(&estimated, &DMatrix::from_row_slice(2, 2, &bad)),
                None
            );
        }
        assert_eq!(Covariance::new(&estimated, &DMatrix::identity(3, 3)), None);
    }
}
