//! Standard deviation of depth that the calibration causes.

use super::{Measured, Triangulator};
use phasmid_geometry::Rig;
use rayon::prelude::*;

/// A camera pixel and the projector coordinates that lit it, along x and along y.
pub type Lit = ([f64; 2], [Option<Measured>; 2]);

impl Triangulator {
    /// Computes the standard deviation in mm that errors of the calibration cause in the depth of each
    /// pixel, to first order, from the covariance of the rig. These errors are common to all scans and
    /// nearly equal at neighbouring pixels; the sigma of noise does not contain them. NaN where
    /// a pixel has no depth; infinite where it has none with a rig one standard deviation away; `None`
    /// if the rig has no covariance.
    pub fn calibration_sigma(&self, pixels: &[Lit]) -> Option<Vec<f64>> {
        let covariance = self.rig.covariance.as_ref()?;
        // Effects of independent steps add up in squares.
        let pairs: Vec<[Self; 2]> = covariance
            .steps()
            .map(|step| {
                [1.0, -1.0].map(|sign| Self::bare(&self.rig.stepped(&step.map(|s| sign * s))))
            })
            .collect();
        let sigma = pixels.par_iter().map(|(px, [x, y])| {
            let depth = |of: &Self| of.depth(*px, *x, *y).map_or(f64::NAN, |(depth, _)| depth);
            let effect = |[up, down]: &[Self; 2]| 0.5 * (depth(up) - depth(down));
            if depth(self).is_nan() {
                return f64::NAN;
            }
            let square: f64 = pairs.iter().map(|pair| effect(pair).powi(2)).sum();
            if square.is_nan() {
                f64::INFINITY
            } else {
                square.sqrt()
            }
        });
        Some(sigma.collect())
    }

    /// Without a table of rays: for [`Self::depth`] only.
    fn bare(rig: &Rig) -> Self {
        Self::with_rays(rig, 0, [Vec::new(), Vec::new()])
    }
}
