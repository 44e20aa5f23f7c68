//! Means over patients and of differences between pairs of inputs, with confidence intervals.

use phasmid_report::lab::{Row, Rows};

/// Two-sided 95 % quantiles of Student's distribution with 1 to 14 degrees of freedom.
const STUDENT: [f64; 14] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160,
    2.145,
];

/// Mean, standard deviation and half of the 95 % interval of a mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spread {
    pub(super) mean: f64,
    /// Standard deviation of the values; NaN for fewer than two values.
    pub(super) deviation: f64,
    /// Half of the interval; NaN for fewer than two values.
    pub(super) half: f64,
}

impl Spread {
    pub(super) fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        let deviation = match values.len() {
            0 | 1 => f64::NAN,
            _ => (squares / (n - 1.0)).sqrt(),
        };
        let student = match values.len() {
            0 | 1 => f64::NAN,
            count => STUDENT.get(count - 2).copied().unwrap_or(1.96),
        };
        Self {
            mean,
            deviation,
            half: student * deviation / n.sqrt(),
        }
    }
}

/// Returns the rows of one input, for one patient if a name is given.
pub(super) fn of<'a>(
    rows: &'a Rows,
    input: &'a str,
    patient: Option<&'a str>,
) -> impl Iterator<Item = &'a Row> {
    rows.with("input", input)
        .filter(move |row| patient.is_none_or(|name| row.get("patient") == name))
}

/// Returns a column's values for one patient and one input, in the order of the moments.
pub(super) fn values(rows: &Rows, input: &str, patient: &str, column: &str) -> Vec<f64> {
    of(rows, input, Some(patient))
        .map(|row| row.value(column))
        .collect()
}

/// Returns the spread over patients of each patient's mean difference between two columns of two
/// inputs: the moments of one patient are not independent. Moments without a result are left out.
pub(super) fn difference(
    rows: &Rows,
    patients: &[&str],
    [with, without]: [(&str, &str); 2],
) -> Spread {
    let mean = |patient: &&str| {
        let [a, b] = [with, without].map(|(input, column)| values(rows, input, patient, column));
        let off: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let off: Vec<f64> = off.into_iter().filter(|v| v.is_finite()).collect();
        off.iter().sum::<f64>() / off.len() as f64
    };
    let means: Vec<f64> = patients
        .iter()
        .map(mean)
        .filter(|m| m.is_finite())
        .collect();
    Spread::of(&means)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_report::lab::Row;

    #[test]
    fn an_interval_is_that_of_students_distribution() {
        // Student's sleep data (Biometrika 6, 1908): mean 1.58, standard deviation 1.23, t = 4.06.
        let gain = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4];
        let spread = Spread::of(&gain);
        assert!((spread.mean - 1.58).abs() < 1e-12);
        assert!((spread.deviation - 1.23).abs() < 5e-4);
        assert!((spread.half - 2.262 * 1.58 / 4.0621).abs() < 1e-3);
        assert!(Spread::of(&[1.0]).half.is_nan());
    }

    #[test]
    fn differences_are_taken_moment_by_moment_and_patient_by_patient() {
        let row = |patient: &str, input: &str, value: f64| {
            let row = Row::new().text("patient", patient).text("input", input);
            row.number("tpe_mm", value)
        };
        let rows = Rows {
            all: vec![
                row("a", "ideal", 1.0),
                row("a", "ideal", 2.0),
                row("a", "scanned", 1.5),
                row("a", "scanned", f64::NAN),
                row("b", "ideal", 4.0),
                row("b", "scanned", 5.5),
            ],
        };
        let pair = [("scanned", "tpe_mm"), ("ideal", "tpe_mm")];
        let found = difference(&rows, &["a", "b"], pair);
        assert_eq!(found.mean, 1.0);
        assert!((found.deviation - 0.5f64.sqrt()).abs() < 1e-15);
    }
}
