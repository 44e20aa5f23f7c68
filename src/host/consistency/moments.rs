//! Sums over pixels of products of frames. What the fit of fringes leaves of a set's samples, summed
//! over the pixels, is `sum of R_ij S_ij` with `R = 1 - H`, H the projection onto the span of 1, cos and
//! sin of the steps, and `S = sum of I I'`: another order of the steps, or one step less, costs nothing
//! per pixel.

use nalgebra::DMatrix;
use phasmid_decode::FringeSet;

/// Part of the summed squares that is rounding.
const ROUNDING: f64 = 1e-12;

/// Sums over pixels.
pub(super) struct Moments {
    frames: Vec<usize>,
    /// Of the products of two frames each, in DN^2.
    sums: DMatrix<f64>,
}

impl Moments {
    /// Of frames in pixels that each have their values in every frame of the sequence.
    pub(super) fn of(frames: Vec<usize>, pixels: &[&[f32]]) -> Self {
        let n = frames.len();
        let mut sums = DMatrix::zeros(n, n);
        let mut values = vec![0.0; n];
        for pixel in pixels {
            for (value, frame) in values.iter_mut().zip(&frames) {
                *value = f64::from(pixel[*frame]);
            }
            for a in 0..n {
                for b in 0..=a {
                    sums[(b, a)] += values[a] * values[b];
                }
            }
        }
        sums.fill_lower_triangle_with_upper_triangle();
        Self { frames, sums }
    }

    /// Those of some of the frames, in their order; all of them have to be among ours.
    pub(super) fn ordered(&self, frames: &[usize]) -> DMatrix<f64> {
        let place = |frame: &usize| self.frames.iter().position(|f| f == frame);
        let places: Vec<usize> = frames.iter().filter_map(place).collect();
        debug_assert_eq!(places.len(), frames.len());
        DMatrix::from_fn(places.len(), places.len(), |a, b| {
            self.sums[(places[a], places[b])]
        })
    }

    /// Sum of squared residuals with the steps of sets, of which `rest` is the operator, taken from
    /// `frames`, in DN^2; 0 where it is rounding.
    pub(super) fn residual(&self, rest: &DMatrix<f64>, frames: &[usize]) -> f64 {
        let sums = self.ordered(frames);
        let left = rest.dot(&sums);
        if left > ROUNDING * sums.trace() {
            left
        } else {
            0.0
        }
    }

    /// Sum of squared deviations from each pixel's mean over `frames`, in DN^2.
    pub(super) fn variance(&self, frames: &[usize]) -> f64 {
        let sums = self.ordered(frames);
        sums.trace() - sums.sum() / frames.len() as f64
    }
}

/// `1 - H` of the steps of sets, one after the other: each has its own fringe, and all have one mean.
pub(super) fn rest(sets: &[&FringeSet]) -> DMatrix<f64> {
    let n: usize = sets.iter().map(|set| set.phases.len()).sum();
    let mut model = DMatrix::zeros(n, 1 + 2 * sets.len());
    let steps = sets.iter().enumerate();
    let steps = steps.flat_map(|(i, set)| set.phases.iter().map(move |phase| (i, phase)));
    for (row, (i, phase)) in steps.enumerate() {
        model[(row, 0)] = 1.0;
        model[(row, 1 + 2 * i)] = phase.cos();
        model[(row, 2 + 2 * i)] = phase.sin();
    }
    let rest = DMatrix::identity(n, n);
    // A set whose steps tell its mean and its fringe has a regular matrix.
    match (model.transpose() * &model).cholesky() {
        Some(normal) => rest - &model * normal.solve(&model.transpose()),
        None => rest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn residuals_are_those_of_the_pixels_one_by_one() {
        // Unequal steps, the frames of the set in no order, one frame that is none of it.
        let phases = vec![0.1, 1.0, 2.3, 3.3, 4.9];
        let frames = vec![4, 1, 0, 5, 2];
        let set = FringeSet::new("t", 16.0, frames.clone(), phases).unwrap();
        let pixels: Vec<Vec<f32>> = (0..50)
            .map(|p| {
                let value = |k: i32| (97 * p + 61 * k * k + 13 * p * k) % 251;
                (0..6).map(|k| value(k) as f32).collect()
            })
            .collect();
        let views: Vec<&[f32]> = pixels.iter().map(Vec::as_slice).collect();
        let moments = Moments::of((0..6).collect(), &views);
        for order in [frames, vec![3, 1, 0, 5, 2], vec![1, 4, 0, 5, 2]] {
            let samples = |pixel: &Vec<f32>| -> Vec<f64> {
                order.iter().map(|f| f64::from(pixel[*f])).collect()
            };
            let want: f64 = pixels.iter().map(|p| set.residual(&samples(p))).sum();
            let found = moments.residual(&rest(&[&set]), &order);
            assert!(
                (found / want - 1.0).abs() < 1e-9,
                "{found}, expected {want}"
            );
            let spread = |pixel: &Vec<f32>| {
                let samples = samples(pixel);
                let mean = samples.iter().sum::<f64>() / samples.len() as f64;
                samples.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
            };
            let want: f64 = pixels.iter().map(spread).sum();
            assert!((moments.variance(&order) / want - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn sets_of_three_steps_are_tied_by_their_mean() {
        let phases = |first: f64| vec![first, first + 2.0, first + 4.5];
        let one = FringeSet::new("t", 16.0, vec![0, 1, 2], phases(0.0)).unwrap();
        let other = FringeSet::new("t", 160.0, vec![3, 4, 5], phases(0.3)).unwrap();
        let rest = rest(&[&one, &other]);
        // Two fringes and a mean of six samples leave one number, the difference of the means.
        assert!((rest.trace() - 1.0).abs() < 1e-9);
        let mean = |set: &FringeSet, p: usize| {
            let at = |k: usize| set.weights.get(k.wrapping_sub(p)).map_or(0.0, |w| w[0]);
            DVector::from_fn(6, |k, _| at(k))
        };
        let difference = mean(&one, 0) - mean(&other, 3);
        let kept = &rest * &difference;
        assert!((kept - &difference).norm() < 1e-9);
    }

    #[test]
    fn fringes_without_noise_leave_nothing() {
        let phases: Vec<f64> = (0..5).map(|k| f64::from(k) * 1.1).collect();
        let set = FringeSet::new("t", 16.0, (0..5).collect(), phases).unwrap();
        let flat = [200.0f32; 5];
        let moments = Moments::of((0..5).collect(), &[&flat[..]; 100]);
        assert_eq!(moments.residual(&rest(&[&set]), &[0, 1, 2, 3, 4]), 0.0);
    }
}
