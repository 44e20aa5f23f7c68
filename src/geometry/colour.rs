//! Converts file colours to reflectance.

/// Converts an sRGB component, 0 to 1, to linear light (IEC 61966-2-1).
#[inline]
pub fn linear(component: f64) -> f64 {
    if component <= 0.04045 {
        component / 12.92
    } else {
        ((component + 0.055) / 1.055).powf(2.4)
    }
}

/// Returns the reflectance of a colour from its linear components: their luminance (ITU-R BT.709),
/// independent of the projector's wavelength. Three components do not define a spectrum, and mono
/// cameras under green light see nearly the luminance.
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Returns the reflectance of an sRGB colour with components 0 to 1.
pub(crate) fn reflectance(srgb: [f64; 3]) -> f32 {
    luminance(srgb.map(linear)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectance_matches_the_srgb_standard() {
        assert!((reflectance([1.0; 3]) - 1.0).abs() < 1e-6);
        assert_eq!(reflectance([0.0; 3]), 0.0);
        // Photographers' 18 % grey is 118 of 255 in sRGB: 0.1812.
        assert!((reflectance([118.0 / 255.0; 3]) - 0.1812).abs() < 1e-4);
        assert!((reflectance([0.0, 1.0, 0.0]) - 0.7152).abs() < 1e-6);
    }
}
