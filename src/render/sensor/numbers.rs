//! Per-frame sensor parameters for the GPU version of this pass.

use super::Sensor;

/// All parameters of [`Sensor`] except its fixed pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Numbers {
    /// Seed and noise id.
    pub(crate) key: [u64; 2],
    pub(crate) read_noise_e: f32,
    pub(crate) full_well_e: f32,
    /// Mean from which shot and read noise are drawn separately; infinite if they never are.
    pub(crate) apart_from_e: f32,
    pub(crate) dark_e: f32,
    pub(crate) gain_dn_per_e: f32,
    pub(crate) black_dn: f32,
    pub(crate) full_scale_dn: f32,
    /// Exponent of the response; 1 if it is linear.
    pub(crate) exponent: f32,
    /// Whether a pixel takes two bytes.
    pub(crate) wide: bool,
}

impl Sensor<'_> {
    /// Returns the parameters; terms that the plan disables get neutral values.
    pub(crate) fn numbers(&self) -> Numbers {
        let noise = self.noise.as_ref();
        Numbers {
            key: noise.map_or([0; 2], |n| n.key),
            read_noise_e: noise.map_or(0.0, |n| n.read_noise_e),
            full_well_e: self.linear.full_well_e,
            apart_from_e: noise.map_or(f32::INFINITY, |n| n.apart_from_e),
            dark_e: self.dark_e.unwrap_or(0.0),
            gain_dn_per_e: self.linear.gain_dn_per_e,
            black_dn: self.linear.black_dn,
            full_scale_dn: self.linear.full_scale_dn,
            exponent: self.response.as_ref().map_or(1.0, |r| r.exponent),
            wide: self.wide,
        }
    }
}
