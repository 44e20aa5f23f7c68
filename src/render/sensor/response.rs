//! The response of [`profile::CameraResponse`](phasmid_profile::CameraResponse) in f32, vectorized.

use super::elementary::{exp_negative, ln};
use phasmid_profile as profile;

/// A non-linear response: full (linear / full)^exponent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Response {
    full_scale_dn: f32,
    pub(super) exponent: f32,
}

impl Response {
    pub(super) fn new(response: &profile::CameraResponse, full_scale_dn: f64) -> Self {
        Self {
            full_scale_dn: full_scale_dn as f32,
            exponent: match response {
                profile::CameraResponse::Linear {} => 1.0,
                profile::CameraResponse::Gamma { gamma } => (1.0 / gamma) as f32,
            },
        }
    }

    /// Maps a linear digital number from 0 to full scale to the digital number in the frame. The
    /// error is at most 1e-6 of full scale; with an exponent of 1 the number is unchanged.
    #[inline(always)]
    pub(super) fn bend(&self, linear_dn: f32) -> f32 {
        /// Smaller values, as a fraction of full scale, are treated as zero. Even raised to the
        /// power of 1/4, they stay below 0.006.
        const LEAST: f32 = 1e-9;
        let share = linear_dn / self.full_scale_dn;
        let some = if share > LEAST { share } else { LEAST };
        let bent = self.full_scale_dn * exp_negative(-ln(some) * self.exponent);
        let bent = if share > LEAST { bent } else { 0.0 };
        if self.exponent == 1.0 {
            linear_dn
        } else {
            bent
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn response_follows_its_curve_and_inverts() {
        for gamma in [0.25, 0.45, 2.2, 4.0] {
            let curve = profile::CameraResponse::Gamma { gamma };
            for full in [255.0, 65535.0] {
                let response = Response::new(&curve, full);
                for k in 0..=20_000 {
                    let linear = full * f64::from(k) / 20_000.0;
                    let dn = curve.apply(linear, full);
                    let fast = f64::from(response.bend(linear as f32));
                    assert!(
                        (fast - dn).abs() < 2e-6 * full,
                        "{gamma} {linear}: {fast} {dn}"
                    );
                    assert!((curve.invert(dn, full) - linear).abs() < 1e-9 * full);
                }
            }
        }
    }

    #[test]
    fn a_gamma_of_one_changes_nothing() {
        let response = Response::new(&profile::CameraResponse::Gamma { gamma: 1.0 }, 255.0);
        for dn in [0.0, 1e-8, 0.3, 17.2, 255.0] {
            assert_eq!(response.bend(dn), dn);
        }
    }
}
