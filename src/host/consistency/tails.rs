//! Frames that end in rows which nothing wrote.
//!
//! What comes after lost rows moves up, and as many rows at the bottom stay empty: all zeros. Where no
//! edge or shade shows that rows moved, and where all frames lack them alike, this tells it alone.
//!
//! A row without light is zero too, before a camera without noise or black level. So the row above the
//! empty ones has to be written all over, and as bright as the one above it: where light ends along a
//! row it fades first. Frames whose patterns vary down the image end in the middle of one; they are left
//! out.

use super::grid::read_row;
use phasmid_pattern::{Image, Samples};

/// Parts of a row that each have to be written.
const PARTS: usize = 16;
/// Part of their pixels, one in so many.
const WRITTEN: usize = 8;
/// How bright the last row is at least, in parts of the one above it.
const AS_BRIGHT: f32 = 0.75;

/// Whether frames end in empty rows. Frames are of one size; `down` are those that vary down the image.
pub(super) fn check(frames: &[Image], down: &[bool]) -> Result<(), String> {
    for (k, frame) in frames.iter().enumerate() {
        let rows = empty_rows(frame);
        if rows > 0 && !down[k] && is_cut(frame, rows) {
            return Err(format!(
                "frame {k} ends in {} of zeros below a row that is lit or has noise: rows are missing",
                match rows {
                    1 => "a row".to_owned(),
                    rows => format!("{rows} rows"),
                }
            ));
        }
    }
    Ok(())
}

/// Rows at the bottom that are all zeros.
fn empty_rows(frame: &Image) -> usize {
    fn of<T: Copy + PartialEq + Default>(samples: &[T], width: usize) -> usize {
        let rows = samples.chunks_exact(width.max(1)).rev();
        rows.take_while(|row| row.iter().all(|sample| *sample == T::default()))
            .count()
    }
    match frame.samples() {
        Samples::U8(samples) => of(samples, frame.width()),
        Samples::U16(samples) => of(samples, frame.width()),
    }
}

/// Whether the row above so many is written all over, and no darker than the one above it.
fn is_cut(frame: &Image, rows: usize) -> bool {
    let (width, height) = (frame.width(), frame.height());
    if width < PARTS * WRITTEN || height < rows + 2 {
        return false;
    }
    let (mut last, mut above) = (Vec::new(), Vec::new());
    read_row(frame, height - rows - 1, 1, &mut last);
    read_row(frame, height - rows - 2, 1, &mut above);
    let written = |part: &[f32]| part.iter().filter(|v| **v > 0.0).count() * WRITTEN >= part.len();
    last.chunks(width.div_ceil(PARTS)).all(written)
        && last.iter().sum::<f32>() >= AS_BRIGHT * above.iter().sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of `bits` by the value of each row and column.
    fn frame(bits: u32, value: impl Fn(usize, usize) -> u16) -> Image {
        let (width, height) = (160, 12);
        let pixels = (0..width * height).map(|i| value(i / width, i % width));
        let samples = match bits {
            8 => Samples::U8(pixels.map(|v| v as u8).collect()),
            _ => Samples::U16(pixels.collect()),
        };
        Image::new(width, height, samples).unwrap()
    }

    #[test]
    fn empty_rows_below_written_ones_are_told_and_counted() {
        for bits in [8, 16] {
            let cut = |rows: usize| {
                frame(
                    bits,
                    move |r, c| if r < 12 - rows { 90 + c as u16 } else { 0 },
                )
            };
            assert_eq!(check(&[cut(0)], &[false]), Ok(()));
            assert_eq!(check(&[cut(12)], &[false]), Ok(()), "dark all over");
            let one = check(&[cut(0), cut(1)], &[false; 2]).unwrap_err();
            assert!(one.starts_with("frame 1 ends in a row of zeros"), "{one}");
            let many = check(&[cut(5), cut(5)], &[false; 2]).unwrap_err();
            assert!(
                many.starts_with("frame 0 ends in 5 rows of zeros"),
                "{many}"
            );
            assert_eq!(
                check(&[cut(5)], &[true]),
                Ok(()),
                "a pattern down the image"
            );
        }
    }

    #[test]
    fn noise_alone_is_written() {
        let noise = |r: usize, c: usize| u16::from((r * 31 + c * 17).is_multiple_of(5));
        let cut = frame(8, |r, c| if r < 10 { noise(r, c) } else { 0 });
        assert!(check(&[cut], &[false]).is_err());
    }

    #[test]
    fn light_that_ends_is_no_cut() {
        // Along a row, fading over one; and beside an object that stands in the last lit rows.
        let field = frame(8, |r, _| [200, 90, 0][r.saturating_sub(7).min(2)]);
        let object = frame(8, |r, c| if r < 9 && c < 120 { 200 } else { 0 });
        assert_eq!(check(&[field, object], &[false; 2]), Ok(()));
    }
}
