//! Ground truth: the geometry and light of the scene at each pixel. It leaves the device on a
//! channel that no physical scanner has, never on the control port.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Ground truth of a scene at one instant over the camera's pixels, row-major; NaN where missing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Truth {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Depth z of the surface point that the pixel's centre sees, in the camera's frame, in
    /// millimetres.
    pub depth_mm: Vec<f32>,
    /// Projector column of that point; also given outside the projector's field and in shadow.
    pub projector_x: Vec<f32>,
    /// Projector row of that point; also given outside the projector's field and in shadow.
    pub projector_y: Vec<f32>,
    /// The surface point that the pixel's centre sees, in the rig's frame (the camera's), in
    /// millimetres.
    pub point_mm: Vec<[f32; 3]>,
    /// Unit normal of the surface on the camera's side, in the rig's frame.
    pub normal: Vec<[f32; 3]>,
    /// Number of the object in the scene, from 0; [`Truth::NO_OBJECT`] if there is none.
    pub object: Vec<u16>,
    /// Fraction of light that the surface reflects diffusely, averaged over the pixel's footprint.
    pub albedo: Vec<f32>,
    /// Irradiance in W/m^2 that the projector's full white gives the surface, without the
    /// projector's blur; 0 in shadow and outside the projector's field.
    pub irradiance_w_m2: Vec<f32>,
    /// Noise-free signal in digital numbers, black level included, averaged over the fringes.
    pub mean_dn: Vec<f32>,
    /// Noise-free modulation B of the sequence's finest fringes in digital numbers.
    pub modulation_dn: Vec<f32>,
    /// Predicted standard deviation of a grey level at `mean_dn`, in digital numbers.
    pub noise_dn: Vec<f32>,
    /// Flags of the pixel: a sum of the `Truth::*` constants.
    pub flags: Vec<u8>,
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
    /// At the pixel, some frame of the sequence's finest fringes is saturated even without noise: it
    /// reads the value of a full well or the converter's maximum.
    pub const SATURATED: u8 = 16;
    /// The finest fringes of the sequence are unresolved at the pixel: its footprint spans at least
    /// one period, so that the contrast vanishes or inverts, or blur leaves less than a twentieth
    /// of the contrast.
    pub const UNRESOLVED: u8 = 32;

    /// The surface belongs to an object that moves or deforms: the other maps are valid for one
    /// instant only.
    pub const MOVING: u8 = 64;

    /// Value of [`Self::object`] where the camera sees no object.
    pub const NO_OBJECT: u16 = u16::MAX;

    /// Names of the maps of [`Self::maps`].
    pub const MAPS: [&'static str; 14] = [
        "depth_mm",
        "projector_x",
        "projector_y",
        "point_x_mm",
        "point_y_mm",
        "normal_x",
        "normal_y",
        "normal_z",
        "object",
        "albedo",
        "irradiance_w_m2",
        "mean_dn",
        "modulation_dn",
        "noise_dn",
    ];

    /// Returns the maps with their names, as numbers, in the order of the truth channel. The points'
    /// z is the depth.
    pub fn maps(&self) -> Vec<(&'static str, Vec<f32>)> {
        let axis = |of: &[[f32; 3]], axis: usize| of.iter().map(|v| v[axis]).collect();
        let maps = [
            self.depth_mm.clone(),
            self.projector_x.clone(),
            self.projector_y.clone(),
            axis(&self.point_mm, 0),
            axis(&self.point_mm, 1),
            axis(&self.normal, 0),
            axis(&self.normal, 1),
            axis(&self.normal, 2),
            self.object
                .iter()
                .map(|&object| f32::from(object))
                .collect(),
            self.albedo.clone(),
            self.irradiance_w_m2.clone(),
            self.mean_dn.clone(),
            self.modulation_dn.clone(),
            self.noise_dn.clone(),
        ];
        Self::MAPS.into_iter().zip(maps).collect()
    }
}

/// Flags the pixels whose rounded signal reaches the saturation level.
pub(crate) fn flag_saturated(flags: &mut [u8], signal_dn: &[f32], saturation_dn: f64) {
    for (flags, dn) in flags.iter_mut().zip(signal_dn) {
        if f64::from(*dn).round() >= saturation_dn {
            *flags |= Truth::SATURATED;
        }
    }
}

/// Computes the mean and modulation of each of `pixels` pixels from noise-free signals at known
/// phases of one fringe period, by a least-squares fit of A + B cos(x + phase) with normal
/// equations. Returns NaN if there are fewer than three distinct phases.
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
