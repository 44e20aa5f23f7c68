//! Draws maps as images: a title, the map in colours, a colour bar with a unit, and a legend for pixels
//! without a value or beyond the bar.

use crate::colour::Scale;
use crate::font::Font;
use crate::plot::linear_ticks;
use image::imageops::replace;
use image::{Rgb, RgbImage};

const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [32, 32, 36];
/// Colour of a pixel without a value; neither colour scale contains it.
const INVALID: [u8; 3] = [112; 3];
/// Minimum fraction of values beyond the bar for which the legend has an entry.
const BEYOND: f32 = 0.005;

/// A map of values, row-major; NaN where invalid. Missing values at the end count as NaN.
#[derive(Debug, Clone)]
pub struct Map<'a> {
    /// Title: the quantity, without the unit.
    pub title: &'a str,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The values.
    pub values: &'a [f32],
    /// Unit of the values.
    pub unit: &'a str,
    /// Values at the ends of the colour bar.
    pub colours: Colours,
    /// Brightness of each pixel from [`crate::relief::shades`], if the map is drawn as a relief. NaN is
    /// full light. The darkest shade halves a colour, so that it remains recognisable.
    pub relief: Option<&'a [f32]>,
    /// Side of a value's square in pixels of the image.
    pub zoom: u32,
}

/// Colours of a map. Values beyond an end have its colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Colours {
    /// Dark violet at the first value over blue and green to light yellow at the second.
    Range(f32, f32),
    /// Blue at minus the limit over light grey at zero to red at the limit.
    Signed(f32),
}

impl Map<'_> {
    /// Draws the map with title, colour bar and legend.
    pub fn draw(&self) -> RgbImage {
        let (low, high, scale) = match self.colours {
            Colours::Range(low, high) => (low, high, Scale::sizes()),
            Colours::Signed(limit) => (-limit.abs(), limit.abs(), Scale::signs()),
        };
        let map = self.coloured(low, high, &scale);
        let font = Font::for_image(map.height());
        let bar = Bar::new(map.height(), (low, high), self.unit, font);
        let legend = self.legend(low, high, &scale);
        let words: u32 = legend.iter().map(|(_, text)| entry_width(font, text)).sum();
        let header = font.line() * 3 / 2;
        let footer = if legend.is_empty() {
            font.line() / 2
        } else {
            header
        };
        let width = (map.width() + bar.width())
            .max(font.width(self.title) + font.line() / 2)
            .max(words);
        let mut image = RgbImage::from_pixel(width, header + map.height() + footer, Rgb(PAPER));
        font.draw(
            &mut image,
            self.title,
            (font.line() / 4, font.line() / 4),
            INK,
        );
        replace(&mut image, &map, 0, i64::from(header));
        bar.draw(&mut image, (map.width(), header), &scale);
        let mut left = font.line() / 4;
        for (colour, text) in legend {
            let (side, top) = (font.line() * 3 / 4, header + map.height() + font.line() / 4);
            rectangle(
                &mut image,
                (left, top + font.line() / 8),
                (side, side),
                colour,
            );
            font.draw(&mut image, &text, (left + font.line(), top), INK);
            left += entry_width(font, &text);
        }
        image
    }

    fn coloured(&self, low: f32, high: f32, scale: &Scale) -> RgbImage {
        // With an empty range, all values get the middle colour.
        let span = high - low;
        let zoom = self.zoom.max(1);
        RgbImage::from_fn(self.width * zoom, self.height * zoom, |x, y| {
            let at = (y / zoom) as usize * self.width as usize + (x / zoom) as usize;
            let v = self.values.get(at).copied().unwrap_or(f32::NAN);
            let t = if span > 0.0 { (v - low) / span } else { 0.5 };
            if v.is_nan() || t.is_nan() {
                return Rgb(INVALID);
            }
            let shade = self.relief.and_then(|shades| shades.get(at)).copied();
            // A surface that faces the camera has a shade of 0.7 and keeps almost its full colour.
            let light = shade
                .filter(|s| !s.is_nan())
                .map_or(1.0, |s| (0.45 + 0.75 * s).clamp(0.5, 1.0));
            Rgb(scale.at(t).map(|c| (f32::from(c) * light).round() as u8))
        })
    }

    /// Returns the legend's colours and texts: for pixels without a value, and for values beyond the
    /// bar if there are more than a few.
    fn legend(&self, low: f32, high: f32, scale: &Scale) -> Vec<([u8; 3], String)> {
        let pixels = self.width as usize * self.height as usize;
        let known = self.values.iter().take(pixels).filter(|v| !v.is_nan());
        let mut legend = Vec::new();
        if known.clone().count() < pixels {
            legend.push((INVALID, "not measured".to_owned()));
        }
        if matches!(self.colours, Colours::Range(..)) {
            let share = |beyond: &dyn Fn(f32) -> bool| {
                known.clone().filter(|v| beyond(**v)).count() as f32 > BEYOND * pixels as f32
            };
            if share(&|v| v < low) {
                legend.push((scale.at(0.0), format!("below {low:.0} {}", self.unit)));
            }
            if share(&|v| v > high) {
                legend.push((scale.at(1.0), format!("above {high:.0} {}", self.unit)));
            }
        }
        legend
    }
}

/// Draws a title above an image.
pub fn titled(title: &str, image: &RgbImage) -> RgbImage {
    let font = Font::for_image(image.height());
    let header = font.line() * 3 / 2;
    let width = image.width().max(font.width(title) + font.line() / 2);
    let height = header + image.height() + font.line() / 2;
    let mut out = RgbImage::from_pixel(width, height, Rgb(PAPER));
    font.draw(&mut out, title, (font.line() / 4, font.line() / 4), INK);
    replace(&mut out, image, 0, i64::from(header));
    out
}

/// Draws images below one another.
pub fn stacked(images: &[RgbImage]) -> RgbImage {
    let width = images.iter().map(RgbImage::width).max().unwrap_or(0);
    let height = images.iter().map(RgbImage::height).sum();
    let mut out = RgbImage::from_pixel(width, height, Rgb(PAPER));
    let mut top = 0;
    for image in images {
        replace(&mut out, image, 0, i64::from(top));
        top += image.height();
    }
    out
}

/// Width of a legend's entry: a square, a text, and the gap to the next entry.
fn entry_width(font: Font, text: &str) -> u32 {
    font.width(text) + 2 * font.line()
}

fn rectangle(image: &mut RgbImage, (x, y): (u32, u32), (w, h): (u32, u32), colour: [u8; 3]) {
    for row in y..(y + h).min(image.height()) {
        for column in x..(x + w).min(image.width()) {
            image.put_pixel(column, row, Rgb(colour));
        }
    }
}

/// The colour bar at the right: a strip of colours with ticks at round values and the unit above.
struct Bar {
    font: Font,
    rows: u32,
    range: (f32, f32),
    ticks: Vec<(f64, String)>,
    unit: String,
}

impl Bar {
    fn new(rows: u32, range: (f32, f32), unit: &str, font: Font) -> Self {
        let (low, high) = (f64::from(range.0), f64::from(range.1));
        let most = (rows / (3 * font.line())).clamp(2, 8) as usize;
        Self {
            font,
            rows,
            range,
            ticks: linear_ticks(low, high, most),
            unit: unit.chars().take(12).collect(),
        }
    }

    /// Width of the strip; also of the gap between map and strip.
    fn thick(&self) -> u32 {
        self.font.line() / 2
    }

    fn width(&self) -> u32 {
        let texts = self.ticks.iter().map(|t| &t.1).chain([&self.unit]);
        let widest = texts.map(|text| self.font.width(text)).max().unwrap_or(0);
        widest + 4 * self.thick()
    }

    fn draw(&self, image: &mut RgbImage, (x, y): (u32, u32), scale: &Scale) {
        let (line, thick) = (self.font.line(), self.thick());
        let left = x + thick;
        self.font.draw(image, &self.unit, (left, y), INK);
        let (top, bottom) = (y + 3 * line / 2, y + self.rows.saturating_sub(line / 2));
        if bottom <= top + line {
            return;
        }
        let last = (bottom - top - 1) as f32;
        for row in top..bottom {
            let colour = scale.at(1.0 - (row - top) as f32 / last);
            rectangle(image, (left, row), (thick, 1), colour);
        }
        let (low, high) = self.range;
        for (at, text) in &self.ticks {
            let t = ((*at as f32 - low) / (high - low)).clamp(0.0, 1.0);
            let row = top + ((1.0 - t) * last).round() as u32;
            rectangle(image, (left + thick, row), (thick / 2, 1), INK);
            let place = (left + 2 * thick, row.saturating_sub(line / 2));
            self.font.draw(image, text, place, INK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: u32, height: u32, values: &[f32], colours: Colours) -> Map<'_> {
        Map {
            title: "depth",
            width,
            height,
            values,
            unit: "mm",
            colours,
            relief: None,
            zoom: 1,
        }
    }

    fn pixels(image: &RgbImage, colour: [u8; 3]) -> usize {
        image.pixels().filter(|p| p.0 == colour).count()
    }

    #[test]
    fn values_are_coloured_and_the_bar_has_the_colours_of_its_ends() {
        let (width, height) = (64, 200);
        let values: Vec<f32> = (0..width * height).map(|i| (i % width) as f32).collect();
        let image = map(width, height, &values, Colours::Range(0.0, 63.0)).draw();
        let header = 24;
        let scale = Scale::sizes();
        assert_eq!(image.get_pixel(0, header + 3).0, scale.at(0.0));
        assert_eq!(image.get_pixel(63, header + 3).0, scale.at(1.0));
        let strip = width + 8;
        assert_eq!(image.get_pixel(strip, header + 24).0, scale.at(1.0));
        assert_eq!(image.get_pixel(strip, header + height - 9).0, scale.at(0.0));
        assert_eq!(pixels(&image, INVALID), 0);
        let title = image
            .enumerate_pixels()
            .filter(|p| p.1 < header && p.2.0[0] < 128);
        assert!(title.count() > 20);
    }

    #[test]
    fn the_legend_names_missing_values_and_values_beyond_the_bar() {
        let mut values = vec![1.0; 100 * 100];
        let legend = |values: &[f32]| -> Vec<String> {
            let map = map(100, 100, values, Colours::Range(0.0, 5.0));
            let entries = map.legend(0.0, 5.0, &Scale::sizes());
            entries.into_iter().map(|entry| entry.1).collect()
        };
        assert!(legend(&values).is_empty());
        values[7] = f32::NAN;
        values[9] = 6.0;
        assert_eq!(legend(&values), ["not measured"]);
        values[1000..2000].fill(6.0);
        assert_eq!(legend(&values), ["not measured", "above 5 mm"]);
        let image = map(100, 100, &values, Colours::Range(0.0, 5.0)).draw();
        // One pixel of the map, and the legend's square of 12 pixels.
        assert_eq!(pixels(&image, INVALID), 1 + 12 * 12);
    }

    #[test]
    fn a_zoomed_map_repeats_each_value() {
        let values = [0.0, 1.0, f32::NAN, 1.0];
        let mut map = map(2, 2, &values, Colours::Signed(1.0));
        map.zoom = 3;
        let coloured = map.coloured(-1.0, 1.0, &Scale::signs());
        assert_eq!(coloured.dimensions(), (6, 6));
        assert_eq!(pixels(&coloured, INVALID), 9);
        assert_eq!(pixels(&coloured, Scale::signs().at(1.0)), 18);
    }

    #[test]
    fn empty_maps_and_extreme_ranges_are_drawn() {
        for (width, height) in [(0, 0), (1, 1), (3, 30), (2, 700)] {
            let values = vec![f32::INFINITY; (width * height / 2) as usize];
            let ranges = [(0.0, 0.0), (1.0, -1.0), (f32::NAN, 0.0), (-1e38, 1e38)];
            let ranges = ranges.map(|(low, high)| Colours::Range(low, high));
            for colours in ranges.into_iter().chain([Colours::Signed(f32::NAN)]) {
                let mut map = map(width, height, &values, colours);
                map.unit = "very long unit \u{3bc}";
                map.draw();
                map.relief = Some(&values);
                map.zoom = 0;
                map.draw();
            }
        }
    }
}
