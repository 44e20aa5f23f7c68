//! A small bitmap font for colour scales: letters are 5 dots high and 3 wide, or 5 wide if necessary.

use image::{Rgb, RgbImage};

/// Height of a letter, and gap between letters, in dots.
const HEIGHT: u32 = 5;
const GAP: u32 = 1;

/// Returns the width and height of a text in pixels, with dots of `dot` pixels.
pub fn size(text: &str, dot: u32) -> (u32, u32) {
    let dots: u32 = text.chars().map(|c| glyph(c).0 + GAP).sum();
    (dots.saturating_sub(GAP) * dot, HEIGHT * dot)
}

/// Draws a text with its upper left corner at (x, y), clipped to the image.
pub fn draw(image: &mut RgbImage, text: &str, (x, y): (u32, u32), dot: u32, colour: [u8; 3]) {
    let mut left = x;
    for letter in text.chars() {
        let (width, rows) = glyph(letter);
        for row in 0..HEIGHT * dot {
            for column in 0..width * dot {
                let bits = rows[(row / dot) as usize];
                let (px, py) = (left + column, y + row);
                if bits >> (width - 1 - column / dot) & 1 == 1
                    && px < image.width()
                    && py < image.height()
                {
                    image.put_pixel(px, py, Rgb(colour));
                }
            }
        }
        left += (width + GAP) * dot;
    }
}

/// Returns the width in dots, and the rows from the top with the leftmost dot as the highest bit. A
/// missing letter is a box.
fn glyph(letter: char) -> (u32, [u8; 5]) {
    let rows = match letter.to_ascii_lowercase() {
        'm' => return (5, [0, 0b11010, 0b10101, 0b10101, 0b10101]),
        'w' => return (5, [0, 0b10101, 0b10101, 0b10101, 0b01010]),
        '0' => [7, 5, 5, 5, 7],
        '1' => [2, 6, 2, 2, 7],
        '2' => [7, 1, 7, 4, 7],
        '3' => [7, 1, 3, 1, 7],
        '4' => [5, 5, 7, 1, 1],
        '5' => [7, 4, 7, 1, 7],
        '6' => [7, 4, 7, 5, 7],
        '7' => [7, 1, 2, 2, 2],
        '8' => [7, 5, 7, 5, 7],
        '9' => [7, 5, 7, 1, 7],
        '-' => [0, 0, 7, 0, 0],
        '+' => [0, 2, 7, 2, 0],
        '.' => [0, 0, 0, 0, 2],
        '/' => [1, 1, 2, 4, 4],
        '%' => [5, 1, 2, 4, 5],
        ' ' => [0; 5],
        'a' => [2, 5, 7, 5, 5],
        'b' => [6, 5, 6, 5, 6],
        'c' => [3, 4, 4, 4, 3],
        'd' => [6, 5, 5, 5, 6],
        'e' => [7, 4, 6, 4, 7],
        'f' => [7, 4, 6, 4, 4],
        'g' => [3, 4, 5, 5, 3],
        'h' => [5, 5, 7, 5, 5],
        'i' => [7, 2, 2, 2, 7],
        'j' => [1, 1, 1, 5, 2],
        'k' => [5, 5, 6, 5, 5],
        'l' => [4, 4, 4, 4, 7],
        'n' => [0, 6, 5, 5, 5],
        'o' => [2, 5, 5, 5, 2],
        'p' => [6, 5, 6, 4, 4],
        'q' => [2, 5, 5, 6, 3],
        'r' => [6, 5, 6, 5, 5],
        's' => [3, 4, 2, 1, 6],
        't' => [7, 2, 2, 2, 2],
        'u' => [5, 5, 5, 5, 7],
        'v' => [5, 5, 5, 5, 2],
        'x' => [5, 5, 2, 5, 5],
        'y' => [5, 5, 2, 2, 2],
        'z' => [7, 1, 2, 4, 7],
        _ => [7, 7, 7, 7, 7],
    };
    (3, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_differ_and_fit() {
        let all = "0123456789-+./% abcdefghijklmnopqrstuvwxyz";
        // 0 and o, 5 and s differ by a dot or two; no two letters are equal.
        for (i, a) in all.char_indices() {
            let (width, rows) = glyph(a);
            assert!(rows.iter().all(|row| row >> width == 0));
            for b in all[i + 1..].chars() {
                assert_ne!(glyph(a), glyph(b), "{a} {b}");
            }
        }
        let mut image = RgbImage::new(20, 8);
        draw(&mut image, "-1.5", (2, 1), 1, [255; 3]);
        assert_eq!(size("-1.5", 1), (15, 5));
        assert_eq!(image.get_pixel(3, 3).0, [255; 3]);
        // Drawing beyond the edge does not panic.
        draw(&mut image, "mm", (18, 6), 3, [9; 3]);
    }
}
