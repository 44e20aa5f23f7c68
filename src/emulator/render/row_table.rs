//! A slide that varies along one axis, prepared for averaging over footprints.
//!
//! A footprint is a parallelogram on the slide. Seen along the axis of a pattern its weight is the
//! convolution of two boxes, as wide as the derivatives a and b of the projector coordinate by the
//! camera's column and row: a trapezoid. A slide is a row of held pixels, so its average under the
//! trapezoid is exact:
//!
//! ```text
//! (S(x + (a+b)/2) - S(x + (a-b)/2) - S(x - (a-b)/2) + S(x - (a+b)/2)) / (a b)
//! ```
//!
//! with S the second antiderivative of the levels, a quadratic on each held pixel. Levels are
//! integers, so the sums are kept in wrapping 32-bit integers relative to the middle, exact
//! however far from the slide's origin. The second difference would cancel where the footprint is
//! small against a held pixel, so only the levels' departure from the one at the middle is summed:
//! nothing where the footprint lies on one held pixel.

use crate::simd::widest;

/// Widest footprint along one axis, in slide pixels; wider ones (surfaces seen edge-on) count as
/// this wide. Doubled sums of 255 over 2000 pixels to either side stay below 2^31.
pub(super) const WIDEST: f32 = 2000.0;
/// The narrower box is kept at least this fraction of the wider one: below, it changes nothing
/// that can be seen, and dividing by it would amplify rounding.
const NARROWEST: f32 = 1.0 / 256.0;
/// Footprints are kept at least this wide, in slide pixels: a fiftieth of a held pixel blurs
/// nothing, and the rounding of positions stays small against it.
const SMALLEST: f32 = 0.02;

/// Makes offsets positive before they are truncated to integers; above any footprint's half.
const ROUND: f32 = 4096.0;
/// Beyond the largest slide.
const LAST_PIXEL: f32 = 65536.0;

/// Pixels averaged side by side.
pub(super) const LANES: usize = 8;
pub(super) type Lanes = [f32; LANES];

/// A row of held pixels with its running sums.
pub(super) struct RowTable {
    cells: Vec<Cell>,
    /// 1 / full level.
    scale: f32,
}

/// A held pixel: its level, and at its left border the first and second antiderivative.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct Cell {
    level: u32,
    sum: u32,
    sum_of_sums: u32,
}

impl RowTable {
    pub(super) fn new(levels: &[u16], scale: f32) -> Self {
        let (mut sum, mut sum_of_sums) = (0u32, 0u32);
        // The second antiderivative gains sum + level / 2 a pixel; it is kept doubled.
        let cells = levels
            .iter()
            .map(|&level| {
                let level = u32::from(level);
                let cell = Cell {
                    level,
                    sum,
                    sum_of_sums,
                };
                sum_of_sums = sum_of_sums
                    .wrapping_add(sum.wrapping_mul(2))
                    .wrapping_add(level);
                sum = sum.wrapping_add(level);
                cell
            })
            .collect();
        Self { cells, scale }
    }

    /// Average levels, 0 to 1, under the trapezoids about `x` whose widths are the sizes of
    /// `slope`. Beyond its ends the slide goes on with its last level: whether light falls there
    /// is the geometry's to say.
    ///
    /// Written lane by lane in stages, so that all but the lookups runs in SIMD registers.
    #[inline(always)]
    pub(super) fn average(&self, x: &Lanes, slope: &[[f32; 2]; LANES]) -> Lanes {
        let last = self.cells.len() as i32 - 1;
        let mut area = [0.0; LANES];
        // The held pixel at the middle, and lookups from the lowest to the highest: `index` of
        // their held pixels and `t`, how far from its left border.
        let mut middle = [0i32; LANES];
        let mut index = [[0i32; LANES]; 4];
        let mut t = [[0.0; LANES]; 4];
        for lane in 0..LANES {
            let a = least(greatest(slope[lane][0].abs(), SMALLEST), WIDEST);
            let b = least(greatest(slope[lane][1].abs(), 0.0), WIDEST);
            let wide = greatest(a, b);
            let narrow = greatest(least(a, b), wide * NARROWEST);
            area[lane] = wide * narrow;
            let (outer, inner) = ((wide + narrow) * 0.5, (wide - narrow) * 0.5);
            // Positions are kept relative to the held pixel at x, so that they round like the
            // footprint and not like the coordinate.
            let here = (least(greatest(x[lane], -0.5), LAST_PIXEL) + 0.5) as i32;
            middle[lane] = here.clamp(0, last);
            let inside = x[lane] - here as f32;
            for (k, offset) in [-outer, -inner, inner, outer].into_iter().enumerate() {
                let offset = inside + offset;
                // Rounds to the nearest; where it errs by one at a border, S goes on smoothly.
                let steps = (offset + (ROUND + 0.5)) as i32 - ROUND as i32;
                let at = (here + steps).clamp(0, last);
                index[k][lane] = at;
                t[k][lane] = offset - (at - here) as f32 + 0.5;
            }
        }
        let cells = |index: &[i32; LANES]| index.map(|i| self.cells[i as usize]);
        let center = cells(&middle);
        let lookups: [[Cell; LANES]; 4] = std::array::from_fn(|k| cells(&index[k]));
        let mut average = [0.0; LANES];
        for lane in 0..LANES {
            let here = center[lane];
            // S of the departure from the middle's level, from the middle pixel's left border.
            let s = |k: usize| {
                let (cell, t) = (lookups[k][lane], t[k][lane]);
                let steps = (index[k][lane] - middle[lane]) as u32;
                let sum = cell.sum.wrapping_sub(here.sum);
                let rise = sum.wrapping_sub(here.level.wrapping_mul(steps));
                let offset = cell
                    .sum_of_sums
                    .wrapping_sub(here.sum_of_sums)
                    .wrapping_sub(here.sum.wrapping_mul(2).wrapping_mul(steps))
                    .wrapping_sub(here.level.wrapping_mul(steps).wrapping_mul(steps));
                let level = cell.level.wrapping_sub(here.level) as i32 as f32;
                0.5 * (offset as i32 as f32) + t * (rise as i32 as f32 + 0.5 * level * t)
            };
            let departure = ((s(3) - s(2)) - (s(1) - s(0))) / area[lane];
            average[lane] = (here.level as i32 as f32 + departure) * self.scale;
        }
        average
    }

    /// The averages of a mixed pixel's samples.
    pub(super) fn average_mixed(&self, x: &[f32; 16], slope: &[[f32; 2]; 16]) -> [f32; 16] {
        along_mixed(self, x, slope)
    }

    /// Memory that the table takes, in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.cells.as_slice())
    }
}

widest! {
    fn along_mixed(row: &RowTable, x: &[f32; 16], slope: &[[f32; 2]; 16]) -> [f32; 16]
        => along_mixed_body
}
#[inline(always)]
fn along_mixed_body(row: &RowTable, x: &[f32; 16], slope: &[[f32; 2]; 16]) -> [f32; 16] {
    let mut levels = [0.0; 16];
    for half in 0..2 {
        let from = half * LANES;
        let x: Lanes = std::array::from_fn(|i| x[from + i]);
        let slope: [[f32; 2]; LANES] = std::array::from_fn(|i| slope[from + i]);
        levels[from..from + LANES].copy_from_slice(&row.average(&x, &slope));
    }
    levels
}

/// The lesser, the bound if NaN; one instruction.
#[inline(always)]
fn least(x: f32, bound: f32) -> f32 {
    if x < bound { x } else { bound }
}

/// The greater, the bound if NaN; one instruction.
#[inline(always)]
fn greatest(x: f32, bound: f32) -> f32 {
    if x > bound { x } else { bound }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn average(row: &RowTable, x: f32, slope: [f32; 2]) -> f64 {
        let all = row.average(&[x; LANES], &[slope; LANES]);
        assert!(all.iter().all(|&a| a == all[0]));
        f64::from(all[0]) * 255.0
    }

    /// The trapezoid against held pixels, by exact clipping of each in f64.
    fn exact(levels: &[u16], x: f64, a: f64, b: f64) -> f64 {
        let (wide, narrow) = (a.max(b), a.min(b));
        // The weight's own antiderivative, from -infinity.
        let ramp = |e: f64| e.max(0.0).powi(2) / 2.0;
        let (outer, inner) = ((wide + narrow) / 2.0, (wide - narrow) / 2.0);
        let weight = |e: f64| {
            let e = e.clamp(-outer, outer);
            (ramp(e + outer) - ramp(e + inner) - ramp(e - inner) + ramp(e - outer))
                / (wide * narrow)
        };
        let last = levels.len() - 1;
        levels
            .iter()
            .enumerate()
            .map(|(i, &level)| {
                let low = if i == 0 { -1e9 } else { i as f64 - 0.5 };
                let high = if i == last { 1e9 } else { i as f64 + 0.5 };
                f64::from(level) * (weight(high - x) - weight(low - x))
            })
            .sum()
    }

    fn random_row() -> Vec<u16> {
        (0..1920u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u16)
            .collect()
    }

    #[test]
    fn footprints_of_all_sizes_are_averaged_exactly() {
        let levels = random_row();
        let row = RowTable::new(&levels, 1.0 / 255.0);
        for (a, b, bar) in [
            (0.02, 0.02, 0.6),
            (0.1, 0.03, 0.12),
            (0.5, 0.4, 0.02),
            (4.35, 0.3, 0.02),
            (4.35, 4.35, 0.02),
            (37.0, 2.0, 0.02),
            (300.0, 300.0, 0.02),
        ] {
            for i in 0..400 {
                let x = 3.0 + i as f32 * 4.77;
                let error = (average(&row, x, [a, -b])
                    - exact(&levels, x.into(), a.into(), b.into()))
                .abs();
                assert!(error < bar, "{a} x {b} at {x}: {error}");
            }
        }
    }

    /// On a machine with AVX2 this compares it with the code for any x86-64.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let row = RowTable::new(&random_row(), 1.0 / 255.0);
        for k in 0..200 {
            let x: [f32; 16] = std::array::from_fn(|i| (k * 16 + i) as f32 * 0.61);
            let slope = std::array::from_fn(|i| [0.3 * i as f32, 0.11 * k as f32]);
            let (wide, narrow) = (
                along_mixed(&row, &x, &slope),
                along_mixed_body(&row, &x, &slope),
            );
            assert_eq!(wide.map(f32::to_bits), narrow.map(f32::to_bits));
        }
    }

    #[test]
    fn one_held_pixel_gives_its_own_level_for_any_footprint_on_it() {
        let levels = random_row();
        let row = RowTable::new(&levels, 1.0 / 255.0);
        for size in [0.0, 1e-30, 1e-4, 0.01, 0.1, 0.3] {
            for x in [0, 7, 1000, 1919] {
                let level = average(&row, x as f32 + 0.1, [size, size]);
                assert!(
                    (level - f64::from(levels[x])).abs() < 1e-3,
                    "{size} {level}"
                );
            }
        }
    }

    #[test]
    fn white_is_white_under_the_widest_footprints_and_beyond_the_ends() {
        let row = RowTable::new(&[255; 1920], 1.0 / 255.0);
        for (a, b) in [
            (1400.0, 1400.0),
            (1460.0, 1460.0),
            (2000.0, 1000.0),
            (1e9, 1e9),
            (f32::NAN, 3.0),
        ] {
            for x in [-300.0, 0.0, 960.0, 1919.0, 2500.0] {
                let level = average(&row, x, [a, b]);
                assert!((level - 255.0).abs() < 0.01, "{a} x {b} at {x}: {level}");
            }
        }
    }
}
