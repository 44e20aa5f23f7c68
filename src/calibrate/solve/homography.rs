//! Homography (projective map) from a board to an image, with outlier detection.
//!
//! Direct linear transformation on points that are centred and scaled first (Hartley and Zisserman,
//! "Multiple View Geometry in Computer Vision", 2nd edition, algorithm 4.2). The robust fit starts
//! from the four-point sample with the least median residual (Rousseeuw, "Least median of squares
//! regression", JASA 1984) and refits to the points that agree with it.

use glam::{DMat3, DVec2, DVec3};
use nalgebra::SMatrix;
use phasmid_core::statistics::median;

/// A point on the board (mm) and its image (pixels).
pub(super) type Pair = (DVec2, DVec2);

/// Minimum number of points per pose. A homography has eight unknowns: four points determine it,
/// two more check it.
pub(super) const FEWEST_POINTS: usize = 6;
/// Points with a residual beyond this multiple of the median are outliers. The factor is large
/// because the residuals still contain the lens distortion.
const OUTLYING: f64 = 10.0;
/// Number of four-point samples. With 30 % outliers, the probability that every sample contains an
/// outlier is 1e-24.
const SAMPLES: u32 = 200;
/// Maximum number of points with which the homography of a four-point sample is scored.
const VOTERS: usize = 100;

/// A homography and the pairs it was fitted to.
pub(super) struct Homography {
    /// Maps (x, y, 1) on the board to the image. Scaled so that the third coordinate is 1 at the
    /// mean of the fitted points.
    pub matrix: DMat3,
    /// For each pair, whether it is an inlier.
    pub fits: Vec<bool>,
}

impl Homography {
    /// Fits a homography. Returns `None` if the points do not determine a homography.
    pub fn fit(pairs: &[Pair], robust: bool) -> Option<Self> {
        if pairs.len() < 4 {
            return None;
        }
        let mut fits = vec![true; pairs.len()];
        let mut matrix = linear(pairs.iter().copied())?;
        if robust {
            matrix = sampled(pairs).unwrap_or(matrix);
            for _ in 0..3 {
                let limit = limit(&matrix, pairs);
                fits = pairs
                    .iter()
                    .map(|p| residual(&matrix, p) <= limit)
                    .collect();
                matrix = linear(
                    pairs
                        .iter()
                        .zip(&fits)
                        .filter(|(_, f)| **f)
                        .map(|(p, _)| *p),
                )?;
            }
        }
        Some(Self { matrix, fits })
    }

    /// Whether the map preserves orientation (is not mirrored).
    pub fn keeps_sense(&self) -> bool {
        // The determinant of the map's derivative is the matrix's determinant over the cube of the
        // third coordinate, which is positive.
        self.matrix.determinant() > 0.0
    }
}

/// Maps a point to the image. Returns NaN for a point beyond the horizon.
pub(super) fn apply(matrix: &DMat3, p: DVec2) -> DVec2 {
    let q = *matrix * p.extend(1.0);
    if q.z > 0.0 {
        q.truncate() / q.z
    } else {
        DVec2::NAN
    }
}

fn residual(matrix: &DMat3, (board, px): &Pair) -> f64 {
    let distance = (apply(matrix, *board) - *px).length();
    if distance.is_nan() {
        f64::INFINITY
    } else {
        distance
    }
}

/// Residual above which a pair is an outlier.
fn limit(matrix: &DMat3, pairs: &[Pair]) -> f64 {
    let mut all: Vec<f64> = pairs.iter().map(|p| residual(matrix, p)).collect();
    let sizes = pairs.iter().map(|p| p.1.abs().max_element());
    OUTLYING * median(&mut all).unwrap_or(f64::INFINITY) + 1e-9 * sizes.fold(0.0, f64::max)
}

/// Best of the homographies through random samples of four points.
fn sampled(pairs: &[Pair]) -> Option<DMat3> {
    let stride = pairs.len().div_ceil(VOTERS);
    let mut draw = draws(pairs.len());
    let mut best: Option<(f64, DMat3)> = None;
    for _ in 0..SAMPLES {
        let Some(matrix) = through([draw(), draw(), draw(), draw()].map(|i| pairs[i])) else {
            continue;
        };
        let voters = pairs.iter().step_by(stride);
        let mut residuals: Vec<f64> = voters.map(|p| residual(&matrix, p)).collect();
        let score = median(&mut residuals).unwrap_or(f64::INFINITY);
        if best.is_none_or(|(least, _)| score < least) {
            best = Some((score, matrix));
        }
    }
    best.map(|(_, matrix)| matrix)
}

/// Homography through four pairs, scaled so that the third coordinate is 1 at the first point.
fn through(four: [Pair; 4]) -> Option<DMat3> {
    // Coordinates relative to the first pair, so that the last column is (0, 0, 1).
    let (from, to) = four[0];
    let (mut system, mut right) = (SMatrix::<f64, 6, 6>::zeros(), SMatrix::<f64, 6, 1>::zeros());
    let [scale_from, scale_to] = [
        four.iter()
            .map(|p| (p.0 - from).length())
            .fold(0.0, f64::max),
        four.iter().map(|p| (p.1 - to).length()).fold(0.0, f64::max),
    ];
    for (i, (board, px)) in four[1..].iter().enumerate() {
        let (p, q) = ((*board - from) / scale_from, (*px - to) / scale_to);
        let rows = [
            [p.x, p.y, 0.0, 0.0, -q.x * p.x, -q.x * p.y],
            [0.0, 0.0, p.x, p.y, -q.y * p.x, -q.y * p.y],
        ];
        for (k, row) in rows.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                system[(2 * i + k, j)] = *value;
            }
            right[2 * i + k] = [q.x, q.y][k];
        }
    }
    let h = system.lu().solve(&right)?;
    let core = DMat3::from_cols(
        DVec3::new(h[0], h[2], h[4]),
        DVec3::new(h[1], h[3], h[5]),
        DVec3::Z,
    );
    let shift = |by: DVec2, scale: f64| {
        DMat3::from_cols(DVec3::X * scale, DVec3::Y * scale, by.extend(1.0))
    };
    let matrix = shift(to, scale_to) * core * shift(-from / scale_from, 1.0 / scale_from);
    matrix.is_finite().then_some(matrix)
}

/// Returns a generator of uniform integers below `count`. The seed is fixed, so fits are
/// reproducible (Knuth's 64-bit congruential generator).
fn draws(count: usize) -> impl FnMut() -> usize {
    let mut state = 1u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % count
    }
}

/// Similarity transform that gives points a mean of zero and a mean squared length of 2.
fn normalising(points: impl Iterator<Item = DVec2> + Clone) -> Option<DMat3> {
    let count = points.clone().count() as f64;
    let mean = points.clone().sum::<DVec2>() / count;
    let square = points.map(|p| (p - mean).length_squared()).sum::<f64>() / count;
    let scale = (2.0 / square).sqrt();
    (scale.is_finite() && scale > 0.0).then(|| {
        DMat3::from_cols(
            DVec3::X * scale,
            DVec3::Y * scale,
            (-mean * scale).extend(1.0),
        )
    })
}

fn linear(pairs: impl Iterator<Item = Pair> + Clone) -> Option<DMat3> {
    let from = normalising(pairs.clone().map(|p| p.0))?;
    let to = normalising(pairs.clone().map(|p| p.1))?;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (board, px) in pairs.clone() {
        let p = (from * board.extend(1.0)).to_array();
        let q = to * px.extend(1.0);
        let mut rows = [[0.0; 9]; 2];
        for i in 0..3 {
            (rows[0][i], rows[0][6 + i]) = (p[i], -q.x * p[i]);
            (rows[1][3 + i], rows[1][6 + i]) = (p[i], -q.y * p[i]);
        }
        for row in rows {
            for i in 0..9 {
                for j in 0..9 {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
    }
    let h = null_vector(normal, 1e-12)?;
    let h = DMat3::from_cols_array(&std::array::from_fn(|i| h[(i % 3) * 3 + i / 3]));
    let mut h = to.inverse() * h * from;
    // Choose the sign that puts the points in front of the camera. If the points lie on both sides
    // of the horizon, no sign fits all of them.
    let mean = pairs.clone().map(|p| p.0).sum::<DVec2>() / pairs.clone().count() as f64;
    let depth = (h * mean.extend(1.0)).z;
    h *= 1.0 / depth;
    (h.is_finite() && depth != 0.0 && h.determinant() != 0.0).then_some(h)
}

/// Eigenvector of the smallest eigenvalue of a symmetric matrix. Returns `None` if the second
/// smallest eigenvalue is not larger than `gap` times the largest, as the null space is then
/// ambiguous.
pub(super) fn null_vector<const N: usize>(m: SMatrix<f64, N, N>, gap: f64) -> Option<[f64; N]> {
    if m.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = nalgebra::DMatrix::from_column_slice(N, N, m.as_slice())
        .try_symmetric_eigen(1e-15, 1000)?;
    let mut order: Vec<usize> = (0..N).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let largest = eigen.eigenvalues[order[N - 1]];
    if !(eigen.eigenvalues[order[1]] > gap * largest) {
        return None;
    }
    Some(std::array::from_fn(|i| eigen.eigenvectors[(i, order[0])]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth() -> DMat3 {
        DMat3::from_cols(
            DVec3::new(1.9, 0.2, 3e-4),
            DVec3::new(-0.3, 2.1, -2e-4),
            DVec3::new(560.0, 240.0, 1.0),
        )
    }

    fn pairs() -> Vec<Pair> {
        (0..25)
            .flat_map(|x| {
                (0..19).map(move |y| DVec2::new(f64::from(x), f64::from(y)) * 24.0 - 250.0)
            })
            .map(|p| (p, apply(&truth(), p)))
            .collect()
    }

    #[test]
    fn exact_points_give_the_exact_homography() {
        let found = Homography::fit(&pairs(), true).unwrap();
        assert!(found.fits.iter().all(|f| *f) && found.keeps_sense());
        for (p, q) in pairs() {
            assert!((apply(&found.matrix, p) - q).length() < 1e-9);
        }
    }

    #[test]
    fn a_third_of_outliers_is_recognised() {
        let mut pairs = pairs();
        for i in (0..pairs.len()).step_by(3) {
            pairs[i].1 += DVec2::new(40.0, (i % 7) as f64 * 30.0 - 90.0);
        }
        let found = Homography::fit(&pairs, true).unwrap();
        for (i, fits) in found.fits.iter().enumerate() {
            assert_eq!(*fits, i % 3 != 0, "{i}");
        }
    }

    #[test]
    fn mirror_is_detected_and_collinear_points_are_refused() {
        let mirrored: Vec<Pair> = pairs()
            .into_iter()
            .map(|(p, q)| (p, DVec2::new(1137.0 - q.x, q.y)))
            .collect();
        assert!(!Homography::fit(&mirrored, true).unwrap().keeps_sense());
        let row: Vec<Pair> = pairs().into_iter().filter(|p| p.0.y == -250.0).collect();
        assert!(Homography::fit(&row, true).is_none());
        assert!(Homography::fit(&[], true).is_none());
    }
}
