//! Text in images: Noto Sans Mono in the sizes that its crate has rasterised.

use image::{Rgb, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

const WEIGHT: FontWeight = FontWeight::Regular;

/// The font in one size.
#[derive(Debug, Clone, Copy)]
pub struct Font(RasterHeight);

impl Font {
    /// Returns the font in a size that suits an image with `rows` rows.
    pub fn for_image(rows: u32) -> Self {
        Self(match rows {
            0..300 => RasterHeight::Size16,
            300..500 => RasterHeight::Size20,
            500..900 => RasterHeight::Size24,
            _ => RasterHeight::Size32,
        })
    }

    /// Returns the height of a line in pixels.
    pub fn line(self) -> u32 {
        self.0.val() as u32
    }

    /// Returns the width of a text in pixels.
    pub fn width(self, text: &str) -> u32 {
        let letter = get_raster_width(WEIGHT, self.0);
        u32::try_from(letter * text.chars().count()).unwrap_or(u32::MAX)
    }

    /// Draws a text with its upper left corner at (x, y), clipped to the image. Characters outside ASCII
    /// become question marks.
    pub fn draw(self, image: &mut RgbImage, text: &str, (x, y): (u32, u32), colour: [u8; 3]) {
        let mut left = x;
        for letter in text.chars() {
            let shown =
                get_raster(letter, WEIGHT, self.0).or_else(|| get_raster('?', WEIGHT, self.0));
            let Some(shown) = shown else { continue };
            for (row, weights) in (y..image.height()).zip(shown.raster()) {
                for (column, weight) in (left..image.width()).zip(*weights) {
                    let weight = f32::from(*weight) / 255.0;
                    let Rgb(under) = image.get_pixel_mut(column, row);
                    for (under, ink) in under.iter_mut().zip(colour) {
                        let mixed = f32::from(*under) * (1.0 - weight) + f32::from(ink) * weight;
                        *under = mixed.round() as u8;
                    }
                }
            }
            left = left.saturating_add(shown.width() as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_within_its_size_and_is_clipped_to_the_image() {
        let font = Font::for_image(100);
        let mut image = RgbImage::new(100, 40);
        font.draw(&mut image, "-1.5 mm", (10, 8), [255; 3]);
        let box_ = (10..10 + font.width("-1.5 mm"), 8..8 + font.line());
        let inked = |image: &RgbImage| -> Vec<(u32, u32)> {
            let pixels = image.enumerate_pixels().filter(|p| p.2.0 != [0; 3]);
            pixels.map(|p| (p.0, p.1)).collect()
        };
        let ink = inked(&image);
        assert!(ink.len() > 50, "{}", ink.len());
        assert!(
            ink.iter()
                .all(|(x, y)| box_.0.contains(x) && box_.1.contains(y))
        );
        for corner in [(95, 35), (200, 0), (0, u32::MAX)] {
            font.draw(&mut image, "wide \u{3bc}", corner, [9; 3]);
        }
    }

    #[test]
    fn a_missing_letter_is_a_question_mark() {
        let drawn = |text| {
            let mut image = RgbImage::new(20, 20);
            Font::for_image(0).draw(&mut image, text, (0, 0), [255; 3]);
            image
        };
        assert_eq!(drawn("\u{4e2d}"), drawn("?"));
        assert_ne!(drawn("0"), drawn("O"));
    }
}
