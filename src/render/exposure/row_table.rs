//! A pattern that varies along one axis, prepared for averaging over footprints.
//!
//! A footprint is a parallelogram on the pattern. Projected onto the pattern axis, its weight is
//! the convolution of two boxes with widths a and b, the derivatives of the projector coordinate
//! with respect to camera column and row: a trapezoid. The pattern is piecewise constant, so its
//! average under the trapezoid is exact:
//!
//! ```text
//! (S(x + (a+b)/2) - S(x + (a-b)/2) - S(x - (a-b)/2) + S(x - (a+b)/2)) / (a b)
//! ```
//!
//! with S the second antiderivative of the levels, which is quadratic on each pixel. Levels are
//! integers: 8 bits as displayed, or 16 bits with a non-linear response. The sums are therefore kept
//! as wrapping integers relative to the centre, which is exact at any distance from the pattern's
//! origin. They contain only differences from the level at the centre, which are zero if the
//! footprint lies within one pixel.
//!
//! The difference of S divided by b suffers cancellation if b is small. If b is less than a pixel,
//! each flank of the trapezoid contains at most one border. The mean of the first antiderivative P
//! over a flank is then the mean of a straight line plus a term for the kink at the border:
//!
//! ```text
//! P(middle of the flank) + (level after the border - level before) t^2 / (2 b)
//! ```
//!
//! with t the length of the flank beyond the border. This has no cancellation, even for b = 0 and
//! for footprints much smaller than a pixel.

use phasmid_core::simd::widest;

/// Maximum width of a footprint along one axis, in pattern pixels; wider footprints (of surfaces
/// seen edge-on) are clamped to it. Doubled sums of 255 over 2000 pixels to either side stay below
/// 2^31.
pub(crate) const WIDEST: f32 = 2000.0;
/// Minimum ratio of the width of the narrower box to the width of the wider one, which avoids
/// division by zero.
const NARROWEST: f32 = 1.0 / 65536.0;
/// Minimum width of a footprint in pattern pixels; smaller footprints are widened to it. So small a
/// footprint has no visible blur, and the rounding of positions stays small relative to it.
const SMALLEST: f32 = 1.0 / 512.0;

/// Maximum coordinate, which lies beyond the end of the largest pattern.
const LAST_PIXEL: f32 = 65536.0;

/// Number of camera pixels averaged per SIMD block.
pub(super) const LANES: usize = 8;
pub(super) type Lanes = [f32; LANES];

/// A row of pattern pixels with the running sums of their levels.
pub(crate) struct RowTable {
    cells: Vec<Cell>,
    /// Inverse of the full level.
    scale: f32,
    /// Whether second sums under a footprint may exceed 2^31, as they may with levels of more than 8
    /// bits.
    long: bool,
}

/// A pattern pixel: its level, and the first and the doubled second antiderivative at its left
/// border.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct Cell {
    level: u32,
    sum: u32,
    sum_of_sums: u64,
}

/// Positions of eight trapezoids on the row.
struct Footprints {
    wide: Lanes,
    narrow: Lanes,
    /// Indices of the pattern pixels at the centres of the trapezoids.
    middle: [i32; LANES],
    /// Indices of the pattern pixels at the four corners of the trapezoids, in ascending order.
    index: [[i32; LANES]; 4],
    /// Distance of each corner from its pixel's left border.
    t: [[f32; LANES]; 4],
}

/// Table values at the corners of eight footprints.
struct Corners {
    level: [[u32; LANES]; 4],
    sum: [[u32; LANES]; 4],
}

impl RowTable {
    /// Creates a table from levels along the axis, of which one unit is the light `scale`.
    pub(super) fn new(levels: &[u16], scale: f32) -> Self {
        let (mut sum, mut sum_of_sums) = (0u32, 0u64);
        // With each pixel the second antiderivative gains sum + level / 2, so it is stored
        // doubled.
        let cells = levels
            .iter()
            .map(|&level| {
                let level = u32::from(level);
                let cell = Cell {
                    level,
                    sum,
                    sum_of_sums,
                };
                sum_of_sums += 2 * u64::from(sum) + u64::from(level);
                sum = sum.wrapping_add(level);
                cell
            })
            .collect();
        Self {
            cells,
            scale,
            long: levels.iter().any(|&level| level > 255),
        }
    }

    /// Returns the average levels, 0 to 1, under the trapezoids with centres `x` and widths
    /// |`slope`|. The pattern is extended by its end levels; the geometry pass decides whether light
    /// arrives there.
    ///
    /// The stages are loops over lanes, so that everything except the lookups runs in SIMD
    /// registers. Closures over lanes are avoided, because they are not inlined.
    #[inline(always)]
    pub(super) fn average(&self, x: &Lanes, slope: &[[f32; 2]; LANES]) -> Lanes {
        let at = self.place(x, slope);
        let found = self.corners(&at.index);
        let mut level = thin(&at, &found);
        if at.narrow.iter().any(|&b| b >= 1.0) {
            let thick = if self.long {
                self.thick::<true>(&at, &found)
            } else {
                self.thick::<false>(&at, &found)
            };
            for lane in 0..LANES {
                if at.narrow[lane] >= 1.0 {
                    level[lane] = thick[lane];
                }
            }
        }
        for level in &mut level {
            *level *= self.scale;
        }
        level
    }

    #[inline(always)]
    fn corners(&self, index: &[[i32; LANES]; 4]) -> Corners {
        let mut found = Corners {
            level: [[0; LANES]; 4],
            sum: [[0; LANES]; 4],
        };
        for k in 0..4 {
            for lane in 0..LANES {
                let cell = &self.cells[index[k][lane] as usize];
                found.level[k][lane] = cell.level;
                found.sum[k][lane] = cell.sum;
            }
        }
        found
    }

    #[inline(always)]
    fn place(&self, x: &Lanes, slope: &[[f32; 2]; LANES]) -> Footprints {
        let last = self.cells.len() as i32 - 1;
        let mut at = Footprints {
            wide: [0.0; LANES],
            narrow: [0.0; LANES],
            middle: [0; LANES],
            index: [[0; LANES]; 4],
            t: [[0.0; LANES]; 4],
        };
        for lane in 0..LANES {
            let a = least(greatest(slope[lane][0].abs(), SMALLEST), WIDEST);
            let b = least(greatest(slope[lane][1].abs(), 0.0), WIDEST);
            let wide = greatest(a, b);
            let narrow = greatest(least(a, b), wide * NARROWEST);
            (at.wide[lane], at.narrow[lane]) = (wide, narrow);
            let (outer, inner) = ((wide + narrow) * 0.5, (wide - narrow) * 0.5);
            // Positions are relative to the pattern pixel at x, so that rounding errors scale with
            // the footprint and not with the coordinate.
            let here = floor(least(greatest(x[lane], -0.5), LAST_PIXEL) + 0.5);
            at.middle[lane] = here.clamp(0, last);
            let inside = x[lane] - here as f32;
            let corners = [-outer, -inner, inner, outer];
            for k in 0..4 {
                // Offset from the left border of the pattern pixel at x.
                let offset = inside + corners[k] + 0.5;
                let index = (here + floor(offset)).clamp(0, last);
                at.index[k][lane] = index;
                at.t[k][lane] = offset - (index - here) as f32;
            }
        }
        at
    }

    /// Returns the average levels relative to the level at the centre, computed by second
    /// differences; `LONG` if the sums need 64 bits.
    #[inline(always)]
    fn thick<const LONG: bool>(&self, at: &Footprints, found: &Corners) -> Lanes {
        let mut average = [0.0; LANES];
        for lane in 0..LANES {
            let here = self.cells[at.middle[lane] as usize];
            // Second antiderivative S of the differences from the level at the centre, starting at
            // the left border of the centre pixel.
            let s = |k: usize| {
                let t = at.t[k][lane];
                let steps = (at.index[k][lane] - at.middle[lane]) as u32;
                let sum = found.sum[k][lane].wrapping_sub(here.sum);
                let rise = sum.wrapping_sub(here.level.wrapping_mul(steps)) as i32 as f32;
                let sums = self.cells[at.index[k][lane] as usize].sum_of_sums;
                let offset = if LONG {
                    let steps = i64::from(steps as i32) as u64;
                    sums.wrapping_sub(here.sum_of_sums)
                        .wrapping_sub((2 * u64::from(here.sum)).wrapping_mul(steps))
                        .wrapping_sub(u64::from(here.level).wrapping_mul(steps.wrapping_mul(steps)))
                        as i64 as f32
                } else {
                    let difference = (sums as u32).wrapping_sub(here.sum_of_sums as u32);
                    difference
                        .wrapping_sub(here.sum.wrapping_mul(2).wrapping_mul(steps))
                        .wrapping_sub(here.level.wrapping_mul(steps).wrapping_mul(steps))
                        as i32 as f32
                };
                let level = found.level[k][lane].wrapping_sub(here.level) as i32 as f32;
                0.5 * offset + t * (rise + 0.5 * level * t)
            };
            let area = at.wide[lane] * at.narrow[lane];
            let departure = ((s(3) - s(2)) - (s(1) - s(0))) / area;
            average[lane] = here.level as i32 as f32 + departure;
        }
        average
    }

    /// Returns the average level of each sample of a mixed pixel.
    pub(super) fn average_mixed(&self, x: &[f32; 16], slope: &[[f32; 2]; 16]) -> [f32; 16] {
        along_mixed(self, x, slope)
    }

    /// Returns the memory size of the table in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.cells.as_slice())
    }

    /// Returns each pattern pixel as four words: level, sum, and sum of sums with its low word
    /// first.
    pub(crate) fn words(&self) -> impl ExactSizeIterator<Item = [u32; 4]> {
        let low = |sums: u64| sums as u32;
        self.cells.iter().map(move |cell| {
            let sums = cell.sum_of_sums;
            [cell.level, cell.sum, low(sums), low(sums >> 32)]
        })
    }

    /// Returns the light, relative to full white, per unit of the levels.
    pub(crate) fn scale(&self) -> f32 {
        self.scale
    }

    /// Returns whether second sums under a footprint may exceed one word.
    pub(crate) fn is_long(&self) -> bool {
        self.long
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

/// Returns the average levels relative to the level at the lowest corner, for a narrower box that is
/// less than a pixel wide.
#[inline(always)]
fn thin(at: &Footprints, found: &Corners) -> Lanes {
    let mut average = [0.0; LANES];
    for lane in 0..LANES {
        let (from, to) = (found.level[0][lane], found.level[2][lane]);
        let narrow = at.narrow[lane];
        let steps = (at.index[2][lane] - at.index[0][lane]) as u32;
        let rise = found.sum[2][lane].wrapping_sub(found.sum[0][lane]);
        let rise = rise.wrapping_sub(from.wrapping_mul(steps)) as i32 as f32;
        let step = to.wrapping_sub(from) as i32 as f32;
        // Contribution of the borders within the two flanks to the mean of P.
        let low = found.level[1][lane].wrapping_sub(from) as i32 as f32;
        let high = found.level[3][lane].wrapping_sub(to) as i32 as f32;
        let (below, above) = (at.t[1][lane], at.t[3][lane]);
        let kinks = (high * (above * above) - low * (below * below)) * (0.5 / narrow);
        let departure = rise + step * (at.t[2][lane] + 0.5 * narrow) + kinks;
        average[lane] = from as i32 as f32 + departure / at.wide[lane];
    }
    average
}

/// Rounds down to an integer; |x| must be below 2^22. A cast would saturate, which takes several
/// instructions.
#[inline(always)]
fn floor(x: f32) -> i32 {
    /// Adding this number to x leaves the integer in the low bits of the sum.
    const WHOLE: f32 = 1.5 * (1u32 << 23) as f32;
    let rounded = x + WHOLE;
    rounded.to_bits().wrapping_sub(WHOLE.to_bits()) as i32 - i32::from(rounded - WHOLE > x)
}

/// Returns the smaller of both values, or the bound if x is NaN, in one instruction.
#[inline(always)]
fn least(x: f32, bound: f32) -> f32 {
    if x < bound { x } else { bound }
}

/// Returns the larger of both values, or the bound if x is NaN, in one instruction.
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

    /// Reference for the average: the trapezoid is clipped exactly against each pixel, in f64.
    fn exact(levels: &[f64], x: f64, a: f64, b: f64) -> f64 {
        let (wide, narrow) = (a.max(b), a.min(b).max(1e-7 * a.max(b)));
        // Antiderivative of a ramp from -infinity, of which the weight of a trapezoid is composed.
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
                level * (weight(high - x) - weight(low - x))
            })
            .sum()
    }

    fn random_row() -> Vec<u16> {
        (0..1920u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u16)
            .collect()
    }

    /// Averages agree with the reference for alternating black and white, which is the hardest row,
    /// and for random rows of 8 and of 16 bits.
    #[test]
    fn footprints_of_all_sizes_are_averaged_exactly() {
        let stripes: Vec<u16> = (0..1920).map(|i| 255 * (i % 2)).collect();
        let fine: Vec<u16> = (0..1920u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 16) as u16)
            .collect();
        for (levels, full) in [(stripes, 255.0), (random_row(), 255.0), (fine, 65535.0)] {
            let row = RowTable::new(&levels, (1.0 / full) as f32);
            let levels: Vec<f64> = levels
                .iter()
                .map(|&level| f64::from(level) * 255.0 / full)
                .collect();
            for (a, b) in [
                (0.002, 0.002),
                (0.02, 0.0),
                (0.02, 0.02),
                (0.1, 0.03),
                (0.5, 0.4),
                (0.99, 0.99),
                (1.0, 1.0),
                (1.0, 1e-5),
                (1.37, 0.999),
                (4.35, 0.0),
                (4.35, 1e-4),
                (4.35, 0.3),
                (4.35, 4.35),
                (37.0, 0.01),
                (37.0, 2.0),
                (300.0, 0.7),
                (300.0, 300.0),
                (1500.0, 1.01),
            ] {
                for i in 0..400 {
                    // In every second case the footprint's centre is close to a border, where errors
                    // are largest.
                    let near = if i % 2 == 0 { 0.0 } else { 0.5 * a };
                    let x = (3.0 + i as f32 * 4.77).round() + 0.5 + near + i as f32 * 1e-4;
                    let error = (average(&row, x, [a, -b])
                        - exact(&levels, x.into(), a.into(), b.into()))
                    .abs();
                    assert!(error < 0.05, "{a} x {b} at {x}, of {full}: {error}");
                }
            }
        }
    }

    /// The results are bit-identical: on a machine with AVX2, the AVX2 code is compared with the
    /// code for any x86-64 machine.
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
    fn footprint_within_one_pixel_has_its_level() {
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
