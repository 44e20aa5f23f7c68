//! Colour scales in Oklab (B. Ottosson, "A perceptual color space for image processing", 2020), in
//! which equal steps look equal. Lightness rises evenly along the sequential scale, and falls off
//! evenly to both sides of zero on the diverging scale.

/// A colour scale with 256 steps.
pub(crate) struct Scale([[u8; 3]; 256]);

impl Scale {
    /// Returns a sequential scale: dark violet over blue and green to light yellow.
    pub(crate) fn sizes() -> Self {
        Self::of(|t| {
            let lightness = 0.27 + 0.66 * t;
            // Hue turns from violet (310 degrees) back to yellow (105).
            let hue = (310.0 - 205.0 * t).to_radians();
            // This chroma stays within the sRGB gamut along the whole scale.
            let chroma = 0.125 + 0.04 * (1.0 - t) * (1.0 - t) + 0.03 * t * t;
            [lightness, chroma * hue.cos(), chroma * hue.sin()]
        })
    }

    /// Returns a diverging scale: blue below zero, light grey at zero, red above.
    pub(crate) fn signs() -> Self {
        Self::of(|t| {
            let s: f64 = 2.0 * t - 1.0;
            let lightness = 0.95 - 0.5 * s.abs();
            let hue = if s < 0.0 { 260.0_f64 } else { 27.0 }.to_radians();
            let chroma = 0.19 * s.abs();
            [lightness, chroma * hue.cos(), chroma * hue.sin()]
        })
    }

    fn of(oklab: impl Fn(f64) -> [f64; 3]) -> Self {
        let mut table = [[0; 3]; 256];
        for (i, colour) in table.iter_mut().enumerate() {
            *colour = srgb(oklab(i as f64 / 255.0));
        }
        Self(table)
    }

    /// Returns the colour at `t` from 0 to 1; values outside are clamped.
    pub(crate) fn at(&self, t: f32) -> [u8; 3] {
        self.0[(t.clamp(0.0, 1.0) * 255.0).round() as usize]
    }
}

/// Converts an Oklab colour (L, a, b) to sRGB (IEC 61966-2-1), clipped to its gamut. The matrices are
/// Ottosson's.
fn srgb([l, a, b]: [f64; 3]) -> [u8; 3] {
    let long = (l + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let medium = (l - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let short = (l - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    [
        4.076_741_662_1 * long - 3.307_711_591_3 * medium + 0.230_969_929_2 * short,
        -1.268_438_004_6 * long + 2.609_757_401_1 * medium - 0.341_319_396_5 * short,
        -0.004_196_086_3 * long - 0.703_418_614_7 * medium + 1.707_614_701_0 * short,
    ]
    .map(|linear| {
        let encoded = if linear <= 0.003_130_8 {
            12.92 * linear
        } else {
            1.055 * linear.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * encoded.clamp(0.0, 1.0)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oklab_conversion_matches_known_colours() {
        assert_eq!(srgb([1.0, 0.0, 0.0]), [255, 255, 255]);
        assert_eq!(srgb([0.0, 0.0, 0.0]), [0, 0, 0]);
        // sRGB red in Oklab, computed from Ottosson's table of XYZ and Oklab pairs.
        assert_eq!(srgb([0.627_955, 0.224_863, 0.125_846]), [255, 0, 0]);
    }

    /// Relative luminance (Rec. 709) of an sRGB colour.
    fn luminance(c: [u8; 3]) -> f64 {
        let linear = c.map(|v| {
            let v = f64::from(v) / 255.0;
            if v <= 0.040_45 {
                v / 12.92
            } else {
                ((v + 0.055) / 1.055).powf(2.4)
            }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    #[test]
    fn lightness_orders_sizes_and_marks_zero_of_signs() {
        let (sizes, signs) = (Scale::sizes(), Scale::signs());
        let at = |scale: &Scale, i: usize| luminance(scale.0[i]);
        for i in 0..255 {
            assert!(at(&sizes, i) < at(&sizes, i + 1) + 2e-3, "step {i}");
        }
        assert!(at(&sizes, 255) > 10.0 * at(&sizes, 0));
        for i in 0..127 {
            assert!(at(&signs, i) < at(&signs, i + 1) + 2e-3, "step {i}");
            assert!(at(&signs, 255 - i) < at(&signs, 254 - i) + 2e-3, "step {i}");
        }
        let [r, _, b] = signs.at(0.1);
        assert!(b > r + 60);
        let [r, _, b] = signs.at(0.9);
        assert!(r > b + 60);
    }
}
