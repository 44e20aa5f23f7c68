//! Ground truth: the actual scene at each pixel. It leaves the device on a channel that no physical
//! scanner has, never on the control port.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Ground truth of a scene at one instant over the camera's pixels, row-major; NaN where missing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Truth {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// z of the surface point at the pixel centre, in the camera's frame, in millimetres.
    pub depth_mm: Vec<f32>,
    /// Projector column of the point, also outside the projector's field or in shadow.
    pub projector_x: Vec<f32>,
    /// Projector row of the point, likewise.
    pub projector_y: Vec<f32>,
    /// Flags of the pixel: a sum of the `Truth::*` constants.
    pub flags: Vec<u8>,
    /// Noise-free signal in digital numbers, black level included, averaged over the fringes.
    pub mean_dn: Vec<f32>,
    /// Noise-free modulation B of the finest fringes in digital numbers.
    pub modulation_dn: Vec<f32>,
}

impl Truth {
    /// The camera's ray meets a surface.
    pub const SEEN: u8 = 1;
    /// The point is in the projector's field and not in shadow.
    pub const LIT: u8 = 2;
    /// Camera and projector rays both meet the surface at less than 80 degrees from its normal.
    pub const SQUARE: u8 = 4;
    /// The pixel's footprint covers more than one facet, object or shadow region.
    pub const CREASE: u8 = 8;
    /// Some frame of the sequence's finest fringes is saturated at the pixel even without noise: it
    /// reads the value of a full well or the converter's maximum.
    pub const SATURATED: u8 = 16;
    /// The finest fringes of the sequence are unresolved at the pixel: its footprint spans at least
    /// one period, so that the contrast vanishes or inverts, or blur leaves less than a twentieth
    /// of the contrast.
    pub const UNRESOLVED: u8 = 32;

    /// The surface belongs to an object that moves or deforms: the other maps are valid for one
    /// instant only.
    pub const MOVING: u8 = 64;

    /// Returns the float maps with their names, in the order of the truth channel.
    pub fn maps(&self) -> [(&'static str, &[f32]); 5] {
        [
            ("depth_mm", &self.depth_mm),
            ("projector_x", &self.projector_x),
            ("projector_y", &self.projector_y),
            ("mean_dn", &self.mean_dn),
            ("modulation_dn", &self.modulation_dn),
        ]
    }
}

/// Flags pixels whose rounded signal is at least the saturation level.
pub(crate) fn flag_saturated(flags: &mut [u8], signal_dn: &[f32], saturation_dn: f64) {
    for (flags, dn) in flags.iter_mut().zip(signal_dn) {
        if f64::from(*dn).round() >= saturation_dn {
            *flags |= Truth::SATURATED;
        }
    }
}

/// Computes the mean and modulation of each of `pixels` pixels from noise-free signals at known
/// phases of one fringe period: the least-squares fit of A + B cos(x + phase), solved by its normal
/// equations. NaN if there are fewer than three distinct phases.
pub(crate) fn harmonic(
    phases: &[f64],
    signals: &[Vec<f32>],
    pixels: usize,
) -> (Vec<f32>, Vec<f32>) {
    let mut normal = DMat3::ZERO;
    let rows: Vec<_> = phases
        .iter()
        .map(|phase| DVec3::new(1.0, phase.cos(), -phase.sin()))
        .collect();
    for row in &rows {
        normal += DMat3::from_cols(*row * row.x, *row * row.y, *row * row.z);
    }
    if normal.determinant().abs() < 1e-9 {
        return (vec![f32::NAN; pixels], vec![f32::NAN; pixels]);
    }
    let weights: Vec<_> = rows.iter().map(|row| normal.inverse() * *row).collect();
    (0..pixels)
        .into_par_iter()
        .map(|i| {
            let fit = weights
                .iter()
                .zip(signals)
                .fold(DVec3::ZERO, |sum, (w, s)| sum + *w * f64::from(s[i]));
            (fit.x as f32, fit.y.hypot(fit.z) as f32)
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cosine_gives_back_its_mean_and_modulation() {
        let phases = [0.0, 0.9, 2.0, 4.4];
        let signals: Vec<_> = phases
            .iter()
            .map(|p: &f64| vec![(70.0 + 31.0 * (1.2 + p).cos()) as f32])
            .collect();
        let (mean, modulation) = harmonic(&phases, &signals, 1);
        assert!((mean[0] - 70.0).abs() < 1e-4 && (modulation[0] - 31.0).abs() < 1e-4);
        assert!(harmonic(&phases[..2], &signals[..2], 1).0[0].is_nan());
    }
}
