//! `parameters.csv` and `covariance.csv`: the estimated parameters and their uncertainty.

use super::number::{exact, field};
use crate::solve::Solution;
use std::io::{Result, Write};

/// Maximum number of parameters (about 100 poses) for which the whole covariance is written. If
/// there are more, only the rig's covariance is written.
const MOST: usize = 640;

/// Number of parameters that belong to the rig. They come first, followed by six for each pose.
pub(super) fn of_rig(solution: &Solution) -> usize {
    let poses = 6 * solution.poses.len();
    solution.parameters.len().saturating_sub(poses)
}

pub(super) fn write_parameters(solution: &Solution, out: &mut impl Write) -> Result<()> {
    writeln!(out, "name,unit,value,sigma")?;
    for p in &solution.parameters {
        let (name, value, sigma) = (field(&p.name), exact(p.value), exact(p.sigma));
        writeln!(out, "{name},{},{value},{sigma}", p.unit)?;
    }
    Ok(())
}

/// Writes the covariance as a square table with the parameter names in the first row and column.
pub(super) fn write(solution: &Solution, out: &mut impl Write) -> Result<()> {
    let all = solution.parameters.len().min(solution.covariance.nrows());
    let count = if all > MOST {
        of_rig(solution).min(all)
    } else {
        all
    };
    let names = || solution.parameters[..count].iter().map(|p| field(&p.name));
    write!(out, "name")?;
    for name in names() {
        write!(out, ",{name}")?;
    }
    writeln!(out)?;
    for (i, name) in names().enumerate() {
        write!(out, "{name}")?;
        for j in 0..count {
            let value = solution.covariance.get((i, j)).copied();
            write!(out, ",{}", exact(value.unwrap_or(f64::NAN)))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A strongly correlated pair of the rig's parameters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pair {
    /// Indices in the list of parameters.
    pub of: [usize; 2],
    /// Their correlation.
    pub correlation: f64,
}

/// Pairs of the rig's parameters with a correlation above `least` in magnitude, strongest first.
pub(super) fn correlated(solution: &Solution, least: f64) -> Vec<Pair> {
    let count = of_rig(solution).min(solution.covariance.nrows());
    let at = |i: usize, j: usize| solution.covariance.get((i, j)).copied().unwrap_or(f64::NAN);
    let mut pairs: Vec<Pair> = (0..count)
        .flat_map(|i| (0..i).map(move |j| [j, i]))
        .map(|of| Pair {
            of,
            correlation: at(of[0], of[1]) / (at(of[0], of[0]) * at(of[1], of[1])).sqrt(),
        })
        .filter(|pair| pair.correlation.abs() > least)
        .collect();
    pairs.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    pairs
}
