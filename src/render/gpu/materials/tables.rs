//! Lookup tables for functions that shaders do not compute.

use crate::exposure::{density, distribution};
use crate::material::{Ggx, Texture};

/// Entries per unit of the table of `soft.wgsl`, and its upper end.
const FINE: usize = 16;
const END: usize = 6;
/// Texel sums are stored as integers in units of one over this.
const UNITS: f64 = (1u64 << 30) as f64;

/// The table of `soft.wgsl`: H(z), g(z) and Phi(-z) at each place.
///
/// g(z) = phi(z) - z Phi(-z) is the amount by which blur raises the foot of a ramp, and H(z) is its
/// integral from 0, 1/4 - ((z^2 + 1) Phi(-z) - z phi(z)) / 2.
pub(super) fn soft() -> impl Iterator<Item = f32> {
    (0..=END * FINE).flat_map(|i| {
        let z = i as f64 / FINE as f64;
        let (tail, density) = (distribution(-z), density(z));
        let integral = 0.25 - ((z * z + 1.0) * tail - z * density) / 2.0;
        [integral, density - z * tail, tail].map(|v| v as f32)
    })
}

/// A material in the layout of `ggx.wgsl`.
pub(super) fn lobe(ggx: &Ggx) -> impl Iterator<Item = f32> {
    let head = [ggx.f0, ggx.alpha, ggx.coupling, 0.0];
    head.into_iter()
        .chain(ggx.reflected.iter().copied())
        .map(|v| v as f32)
}

/// Fixed-point texel sums, low word first. Differences of f64 sums are accurate to 2^-28, and both
/// are exact if all sums are multiples of the unit.
pub(super) fn sums(texture: &Texture) -> impl Iterator<Item = [u32; 2]> {
    texture.sums.iter().map(|&sum| {
        let whole = (sum * UNITS).round() as u64;
        [whole as u32, (whole >> 32) as u32]
    })
}

/// Returns the mean of a whole texture.
pub(super) fn mean(texture: &Texture) -> f32 {
    let texels = (texture.width * texture.height) as f64;
    texture.sums.last().map_or(0.0, |sum| (sum / texels) as f32)
}
