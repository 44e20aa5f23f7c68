//! Fits a plane to the residuals of the smooth map around one board point, for one projector axis.
//!
//! The first iterations use biweights, which tolerate a third of wrong pixels. Later iterations
//! weight all pixels within five standard deviations by their variance alone, and exclude the rest.
//! With normal noise this is least squares, whose covariance is known. `Unread` says why a point
//! has no fit.

use super::super::smooth::Smooth;
use super::cell::Sample;
use glam::{DMat3, DVec2, DVec3};
use phasmid_core::statistics::{biweight, median, normal_scale};

/// Minimum number of pixels of a fit.
pub(super) const PIXELS: usize = 12;
/// Maximum residual of a pixel that the fit uses, in standard deviations.
const KEEP: f64 = 5.0;
/// Maximum ratio of the plane's variance at the point to the variance of the mean of the same
/// pixels. The ratio is 1 in the middle of evenly spread pixels and 4 at their edge.
const UNEVEN: f64 = 4.0;
/// Maximum ratio of the residuals' mean square to the predicted variance. It allows a sigma that is
/// five times too small; a noise estimate may be off by a factor of three. Frames in the wrong
/// order exceed it.
const MISFIT: f64 = 25.0;
/// Numbers of iterations: first reweighting, then trimming.
const ROUNDS: [usize; 2] = [5, 3];

/// Reasons why a point has no projector coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[non_exhaustive]
pub enum Unread {
    /// The sequence does not resolve both axes, or the board has too few points.
    #[error("without both of the projector's coordinates, or with too few of the board's points")]
    Unresolved,
    /// Fewer than 12 pixels around the point were decoded.
    #[error("with fewer than 12 decoded pixels around them")]
    FewPixels,
    /// The decoded pixels lie on one side of the point only.
    #[error("with decoded pixels on one side of them only")]
    OneSided,
    /// The decoded coordinates do not lie on a plane.
    #[error("around which the decoded coordinates contradict each other")]
    Scattered,
}

/// A plane over camera pixels, with the covariance of its coefficients.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AxisFit {
    middle: DVec2,
    /// Camera pixels per unit of the plane's coordinates.
    size: f64,
    terms: DVec3,
    covariance: DMat3,
    pub(super) pixels: usize,
}

/// The plane's value and uncertainty at a pixel.
pub(super) struct At {
    pub(super) value: f64,
    pub(super) slope: DVec2,
    pub(super) variance: f64,
}

struct Row {
    basis: DVec3,
    left: f64,
    /// One over the standard deviation of the pixel.
    certainty: f64,
}

impl AxisFit {
    /// Fits the plane. Returns an error if the pixels around `middle` are too few, one-sided or
    /// inconsistent.
    pub(super) fn new(
        middle: DVec2,
        samples: &[Sample],
        light: &Smooth,
        axis: usize,
    ) -> Result<Self, Unread> {
        if samples.len() < PIXELS {
            return Err(Unread::FewPixels);
        }
        let reach = |s: &Sample| (s.at - middle).abs().max_element();
        let size = samples.iter().map(reach).fold(1.0, f64::max);
        let rows: Vec<Row> = samples
            .iter()
            .map(|s| Row {
                basis: ((s.at - middle) / size).extend(1.0),
                left: s.value[axis] - light.at(s.at)[axis],
                certainty: 1.0 / s.sigma[axis],
            })
            .collect();
        let Robust {
            terms,
            covariance,
            kept,
            ratio,
        } = robust(&rows)?;
        let mut fit = Self {
            middle,
            size,
            terms,
            covariance,
            pixels: kept.len(),
        };
        let weight: f64 = kept.iter().map(|&i| rows[i].certainty.powi(2)).sum();
        let variance = fit.at(middle).variance;
        if !(variance * weight <= UNEVEN && variance > 0.0) {
            return Err(Unread::OneSided);
        }
        // Scale the covariance only now: the test above concerns the positions of the pixels, not
        // their noise.
        fit.covariance *= ratio;
        Ok(fit)
    }

    /// Evaluates the plane at a camera pixel.
    pub(super) fn at(&self, px: DVec2) -> At {
        let basis = ((px - self.middle) / self.size).extend(1.0);
        At {
            value: self.terms.dot(basis),
            slope: self.terms.truncate() / self.size,
            variance: basis.dot(self.covariance * basis),
        }
    }
}

/// A robust fit.
struct Robust {
    terms: DVec3,
    /// Covariance predicted from the pixels' standard deviations.
    covariance: DMat3,
    /// Indices of the rows that were used.
    kept: Vec<usize>,
    /// Ratio of the residuals' mean square to the predicted variance; 1 if the excess may be
    /// chance.
    ratio: f64,
}

fn robust(rows: &[Row]) -> Result<Robust, Unread> {
    let residuals = |terms: DVec3| -> Vec<f64> {
        rows.iter()
            .map(|r| (r.left - terms.dot(r.basis)) * r.certainty)
            .collect()
    };
    // Start from the median, so that wrong pixels do not determine the initial fit.
    let mut lefts: Vec<f64> = rows.iter().map(|r| r.left).collect();
    let mut terms = DVec3::new(0.0, 0.0, median(&mut lefts).unwrap_or(0.0));
    let mut spread = 1.0f64;
    for _ in 0..ROUNDS[0] {
        let off = residuals(terms);
        let mut sizes: Vec<f64> = off.iter().map(|r| r.abs()).collect();
        spread = normal_scale(&mut sizes).unwrap_or(0.0).max(1.0);
        let weights = off.iter().map(|r| biweight(r / spread));
        (terms, _) = solve(rows.iter().zip(weights)).ok_or(Unread::OneSided)?;
    }
    let mut kept = Vec::new();
    let mut covariance = DMat3::ZERO;
    for _ in 0..ROUNDS[1] {
        let off = residuals(terms);
        kept = (0..rows.len())
            .filter(|&i| off[i].abs() <= KEEP * spread)
            .collect();
        if kept.len() < PIXELS.max(rows.len() / 2) {
            return Err(Unread::Scattered);
        }
        let counted = kept.iter().map(|&i| (&rows[i], 1.0));
        (terms, covariance) = solve(counted).ok_or(Unread::OneSided)?;
    }
    let squares: f64 = residuals(terms)
        .iter()
        .enumerate()
        .filter(|(i, _)| kept.binary_search(i).is_ok())
        .map(|(_, r)| r * r)
        .sum();
    let freedom = (kept.len() - 3) as f64;
    let ratio = squares / freedom;
    if !(ratio <= MISFIT) {
        return Err(Unread::Scattered);
    }
    // Largest ratio that may be chance: 1 plus three standard deviations of chi-square per degree
    // of freedom.
    let chance = 1.0 + 3.0 * (2.0 / freedom).sqrt();
    Ok(Robust {
        terms,
        covariance,
        kept,
        ratio: if ratio > chance { ratio } else { 1.0 },
    })
}

/// Solves weighted least squares; returns the terms and their covariance.
fn solve<'a>(rows: impl Iterator<Item = (&'a Row, f64)>) -> Option<(DVec3, DMat3)> {
    let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for (row, weight) in rows {
        let weight = weight * row.certainty.powi(2);
        let basis = row.basis * weight;
        normal += DMat3::from_cols(
            basis * row.basis.x,
            basis * row.basis.y,
            basis * row.basis.z,
        );
        right += basis * row.left;
    }
    // Compare the determinant with its largest possible value: their ratio does not depend on
    // scale.
    let diagonal = normal.x_axis.x * normal.y_axis.y * normal.z_axis.z;
    if !(normal.determinant() > 1e-9 * diagonal) {
        return None;
    }
    let covariance = normal.inverse();
    let terms = covariance * right;
    (terms.is_finite() && covariance.is_finite()).then_some((terms, covariance))
}
