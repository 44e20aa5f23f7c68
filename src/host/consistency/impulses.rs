//! Frames with many pixels that are like none beside them.
//!
//! A flipped bit makes a pixel brighter or darker by half of the camera's range, a quarter and so on. The
//! checks of single pixels call that damage while most pixels are sound; where most are not, they take
//! it for noise. Along a stripe a pixel is like the one before and the one behind it, which are like each
//! other, whatever the surface: where a frame has many that are not, its bits are flipped.

use super::grid::read_row;
use phasmid_pattern::Image;

/// Rows that are looked at, evenly spread.
const ROWS: usize = 32;
/// A pixel is like none when it is so far from both of its neighbours, in parts of the frame's greatest
/// value,
const FAR: f32 = 0.2;
/// and they no farther than this from each other.
const NEAR: f32 = 0.1;
/// All in deviations of the noise, at least.
const SIGMAS: f32 = 8.0;
/// Share of the pixels that are like none from which on bits are flipped.
const SHARE: f64 = 0.02;

/// Whether bits of many pixels are flipped. Frames are of one size; `down` are those whose patterns vary
/// down the image.
pub(super) fn check(frames: &[Image], down: &[bool], noise_dn: f32) -> Result<(), String> {
    for (k, frame) in frames.iter().enumerate() {
        let share = share(frame, down[k], noise_dn);
        if share > SHARE {
            return Err(format!(
                "in frame {k} {:.0} % of the pixels are like none beside them: bits are flipped",
                100.0 * share
            ));
        }
    }
    Ok(())
}

/// The share of the pixels that are like neither neighbour, along a row for patterns that vary down the
/// image and down the image for all others.
fn share(frame: &Image, down: bool, noise_dn: f32) -> f64 {
    let height = frame.height();
    if height < 3 || frame.width() < 3 {
        return 0.0;
    }
    let mut rows: [Vec<f32>; 3] = Default::default();
    let mut top = 0f32;
    let mut found = Vec::new();
    for n in 0..ROWS.min(height - 2) {
        let row = 1 + n * (height - 2) / ROWS.min(height - 2);
        for (near, into) in rows.iter_mut().enumerate() {
            read_row(frame, row + near - 1, 1, into);
        }
        let [above, here, below] = &rows;
        top = here.iter().copied().fold(top, f32::max);
        match down {
            true => found.extend(here.windows(3).map(|w| [w[0], w[1], w[2]])),
            false => {
                let columns = above.iter().zip(here).zip(below);
                found.extend(columns.map(|((a, h), b)| [*a, *h, *b]));
            }
        }
    }
    let far = (FAR * top).max(SIGMAS * noise_dn);
    let near = NEAR * top;
    let is_alone = |&&[a, h, b]: &&[f32; 3]| {
        (a - b).abs() < near && (h - a).abs() > far && (h - b).abs() > far
    };
    let alone = found.iter().filter(is_alone).count();
    alone as f64 / found.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stripes along x of so many pixels, with every so many'th pixel's highest bit flipped.
    fn frame(stripe: usize, every: usize) -> Image {
        let (width, height) = (120, 60);
        let level = |i: usize| {
            let lit = (i % width / stripe).is_multiple_of(2);
            let level: u8 = if lit { 180 } else { 12 };
            // Mixed, so that neither along rows nor along columns runs are struck.
            let mixed = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40;
            let struck = mixed as usize % every == 1;
            if struck { level ^ 0x80 } else { level }
        };
        Image::new(
            width,
            height,
            (0..width * height).map(level).collect::<Vec<u8>>(),
        )
        .unwrap()
    }

    #[test]
    fn many_flipped_bits_are_told_and_stripes_are_none() {
        for stripe in [1, 2, 7] {
            let sound = frame(stripe, usize::MAX);
            assert_eq!(check(std::slice::from_ref(&sound), &[false], 1.0), Ok(()));
            let struck = [sound, frame(stripe, 10)];
            let told = check(&struck, &[false; 2], 1.0).unwrap_err();
            assert!(told.starts_with("in frame 1 "), "{told}");
        }
        // Of patterns down the image the neighbours along a row are asked.
        assert_eq!(check(&[frame(7, usize::MAX)], &[true], 1.0), Ok(()));
        assert!(check(&[frame(7, 10)], &[true], 1.0).is_err());
    }
}
