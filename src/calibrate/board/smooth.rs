//! Smooth map between the images of a plane: a homography plus a polynomial for lens distortion.
//!
//! The two images of a plane's points through two pinholes are related by a homography. Lenses add
//! a smooth offset of some pixels, which a polynomial of low degree in the coordinates follows over
//! the part of an image that a board covers. Both are fitted robustly, so that a few wrong pairs
//! have little effect: iterated least squares with the biweight of Beaton and Tukey (Technometrics
//! 16, 1974), its scale taken from the median of the residuals. The homography's equations are
//! linear in normalised coordinates (Hartley, "In defense of the eight-point algorithm", IEEE PAMI
//! 19, 1997). Each equation is divided by the homography's denominator from the previous iteration,
//! so that residuals are proportional to pixels.

use glam::{DMat2, DMat3, DVec2};
use nalgebra::{DMatrix, DVector};
use phasmid_core::statistics::{biweight, normal_scale};

/// Number of reweighting iterations.
const ROUNDS: usize = 8;
/// Minimum number of pairs per coefficient of the polynomial.
const PAIRS_A_TERM: usize = 4;

/// A smooth map of the plane, fitted to pairs of points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Smooth {
    /// Maps normalised source points to normalised target points.
    homography: DMat3,
    from: Frame,
    to: Frame,
    degree: usize,
    /// Polynomial coefficients in normalised target units: x and y for each monomial.
    terms: Vec<DVec2>,
}

/// Centre and half size of a set of points, for normalisation.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Frame {
    middle: DVec2,
    size: f64,
}

impl Frame {
    fn of(points: impl Iterator<Item = DVec2> + Clone) -> Option<Self> {
        let (low, high) = points.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        });
        let size = (high - low).max_element() / 2.0;
        let middle = (low + high) / 2.0;
        (size > 0.0 && size.is_finite() && middle.is_finite()).then_some(Self { middle, size })
    }

    fn normal(&self, p: DVec2) -> DVec2 {
        (p - self.middle) / self.size
    }
}

impl Smooth {
    /// Fits a map to pairs of source and target points. `degree` is the maximum degree of the
    /// polynomial; few pairs lower it. Returns `None` if the pairs do not determine a homography.
    pub(super) fn fit(pairs: &[(DVec2, DVec2)], degree: usize) -> Option<Self> {
        if pairs.len() < 6 || pairs.iter().any(|(p, q)| !p.is_finite() || !q.is_finite()) {
            return None;
        }
        let from = Frame::of(pairs.iter().map(|pair| pair.0))?;
        let to = Frame::of(pairs.iter().map(|pair| pair.1))?;
        let pairs: Vec<_> = pairs
            .iter()
            .map(|&(p, q)| (from.normal(p), to.normal(q)))
            .collect();
        let homography = homography(&pairs)?;
        let left: Vec<_> = pairs
            .iter()
            .map(|&(p, q)| (p, q - apply(&homography, p)))
            .collect();
        let degree = (0..=degree)
            .rev()
            .find(|&d| PAIRS_A_TERM * count(d) <= pairs.len())?;
        let terms = deviation(&left, degree)?;
        Some(Self {
            homography,
            from,
            to,
            degree,
            terms,
        })
    }

    /// Maps a source point to its target.
    pub(super) fn at(&self, p: DVec2) -> DVec2 {
        let n = self.from.normal(p);
        let mut q = apply(&self.homography, n);
        each_monomial(n, self.degree, |k, value, _| q += self.terms[k] * value);
        self.to.middle + q * self.to.size
    }

    /// Derivative of the target with respect to the source; column j is the derivative with respect
    /// to source coordinate j.
    pub(super) fn slope(&self, p: DVec2) -> DMat2 {
        let n = self.from.normal(p);
        let h = &self.homography;
        let v = *h * n.extend(1.0);
        let q = v.truncate() / v.z;
        let mut columns = [h.x_axis, h.y_axis].map(|c| (c.truncate() - q * c.z) / v.z);
        each_monomial(n, self.degree, |k, _, by| {
            columns[0] += self.terms[k] * by.x;
            columns[1] += self.terms[k] * by.y;
        });
        DMat2::from_cols(columns[0], columns[1]) * (self.to.size / self.from.size)
    }
}

fn apply(h: &DMat3, p: DVec2) -> DVec2 {
    let v = *h * p.extend(1.0);
    v.truncate() / v.z
}

/// Number of monomials x^i y^j with i + j <= degree.
fn count(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// Calls `call` with each monomial's index, value and derivatives with respect to x and y.
fn each_monomial(p: DVec2, degree: usize, mut call: impl FnMut(usize, f64, DVec2)) {
    let mut k = 0;
    let mut y = 1.0;
    let mut y_by = 0.0;
    for j in 0..=degree {
        let (mut x, mut x_by) = (1.0, 0.0);
        for i in 0..=degree - j {
            call(k, x * y, DVec2::new(x_by * y, x * y_by));
            k += 1;
            x_by = x * (i as f64 + 1.0);
            x *= p.x;
        }
        y_by = y * (j as f64 + 1.0);
        y *= p.y;
    }
}

/// Fits the homography of normalised pairs, scaled so that its last entry is 1.
fn homography(pairs: &[(DVec2, DVec2)]) -> Option<DMat3> {
    let mut h = DMat3::IDENTITY;
    let mut weights = vec![1.0; pairs.len()];
    let mut residuals = vec![0.0; pairs.len()];
    for round in 0..ROUNDS {
        let mut normal = DMatrix::<f64>::zeros(8, 8);
        let mut right = DVector::<f64>::zeros(8);
        for (&(p, q), &weight) in pairs.iter().zip(&weights) {
            if weight == 0.0 {
                continue;
            }
            let w = h.row(2).dot(p.extend(1.0));
            let weight = if round == 0 { weight } else { weight / (w * w) };
            for (first, target) in [(0, q.x), (3, q.y)] {
                let mut row = [0.0; 8];
                row[first..first + 3].copy_from_slice(&[p.x, p.y, 1.0]);
                (row[6], row[7]) = (-target * p.x, -target * p.y);
                add(&mut normal, &mut right, &row, target, weight);
            }
        }
        let solved = solve(normal, &right)?;
        let rows: [[f64; 3]; 3] = [
            [solved[0], solved[1], solved[2]],
            [solved[3], solved[4], solved[5]],
            [solved[6], solved[7], 1.0],
        ];
        h = DMat3::from_cols_array_2d(&rows).transpose();
        for (residual, &(p, q)) in residuals.iter_mut().zip(pairs) {
            *residual = (q - apply(&h, p)).length();
        }
        reweigh(&residuals, &mut weights);
    }
    let in_front = pairs
        .iter()
        .zip(&weights)
        .all(|((p, _), &w)| w == 0.0 || h.row(2).dot(p.extend(1.0)) > 0.0);
    (h.is_finite() && in_front).then_some(h)
}

/// Fits a polynomial to the residuals of the homography.
fn deviation(left: &[(DVec2, DVec2)], degree: usize) -> Option<Vec<DVec2>> {
    let n = count(degree);
    let mut row = vec![0.0; n];
    let mut columns = [vec![], vec![]];
    for (axis, column) in columns.iter_mut().enumerate() {
        let mut weights = vec![1.0; left.len()];
        let mut residuals: Vec<f64> = left.iter().map(|(_, d)| d[axis].abs()).collect();
        reweigh(&residuals, &mut weights);
        for _ in 0..ROUNDS {
            let mut normal = DMatrix::<f64>::zeros(n, n);
            let mut right = DVector::<f64>::zeros(n);
            for (&(p, d), &weight) in left.iter().zip(&weights) {
                each_monomial(p, degree, |k, value, _| row[k] = value);
                add(&mut normal, &mut right, &row, d[axis], weight);
            }
            let solved = solve(normal, &right)?;
            for (residual, &(p, d)) in residuals.iter_mut().zip(left) {
                let mut expected = 0.0;
                each_monomial(p, degree, |k, value, _| expected += solved[k] * value);
                *residual = (d[axis] - expected).abs();
            }
            reweigh(&residuals, &mut weights);
            *column = solved.as_slice().to_vec();
        }
    }
    let [x, y] = columns;
    let terms: Vec<_> = x.into_iter().zip(y).map(DVec2::from).collect();
    terms.iter().all(|t| t.is_finite()).then_some(terms)
}

/// Adds one weighted equation to the upper triangle of the normal equations.
fn add(normal: &mut DMatrix<f64>, right: &mut DVector<f64>, row: &[f64], target: f64, weight: f64) {
    for (j, &b) in row.iter().enumerate() {
        let b = b * weight;
        if b == 0.0 {
            continue;
        }
        for (i, &a) in row[..=j].iter().enumerate() {
            normal[(i, j)] += a * b;
        }
        right[j] += b * target;
    }
}

/// Solves normal equations given as an upper triangle, with a ridge that just exceeds rounding errors.
fn solve(mut normal: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    normal.fill_lower_triangle_with_upper_triangle();
    let ridge = 1e-12 * normal.trace() / normal.nrows() as f64;
    for i in 0..normal.nrows() {
        normal[(i, i)] += ridge;
    }
    let solved = normal.cholesky()?.solve(right);
    solved.iter().all(|v| v.is_finite()).then_some(solved)
}

fn reweigh(residuals: &[f64], weights: &mut [f64]) {
    let scale = normal_scale(&mut residuals.to_vec())
        .unwrap_or(0.0)
        .max(1e-12);
    for (weight, &residual) in weights.iter_mut().zip(residuals) {
        *weight = biweight(residual / scale);
    }
}
