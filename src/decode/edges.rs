//! Detects mixed pixels and outliers.
//!
//! A pixel whose footprint covers two surfaces at a depth edge, or is only partly lit, has a
//! coordinate that belongs to neither surface. It is detected because it lies on neither side's
//! linear extrapolation, along the row or along the column. A pixel of a steep or curved surface lies
//! on the extrapolation of at least one side. The tolerance follows the noise, the steps of held
//! projector pixels, the curvature of the extrapolating side, and, where both sides meet in a crease,
//! the change of slope. Nothing is
//! smoothed: a pixel is kept unchanged or rejected.
//!
//! Where the coordinate changes by a fringe period or more per pixel, a pixel averages over the whole
//! fringe. Its contrast vanishes, and for larger changes the fringe appears inverted, so the coordinate
//! is off by half a period. Such pixels are rejected whatever their modulation. Pixels without a
//! neighbour on either side along the row or along the column are rejected too, because their slope is
//! unknown.

use super::turns::nearest;

/// The pixel is kept.
pub(super) const KEEP: u8 = 0;
/// The pixel is on neither side's extrapolation.
pub(super) const MIXED: u8 = 1;
/// The pixel has no neighbours to compare with, along the row or along the column.
pub(super) const STRAY: u8 = 2;

/// The surface is so steep that the pixel spans a period of the finest fringe.
pub(super) const FINE: u8 = 3;

/// Maximum fraction of the finest period that a pixel may span; at this limit a tenth of the contrast
/// remains.
const SPAN: f32 = 0.9;
/// Tolerance in standard deviations: 5 times the noise of a linear extrapolation, which is sqrt(6)
/// times that of one pixel.
const NOISE: f32 = 12.25;
/// Minimum tolerance in projector pixels: far below relevant errors, above the f32 rounding of large
/// coordinates.
const FLOOR_PX: f32 = 0.02;
/// The rows around the judged row v of an axis' map, all of equal length; rows outside the image are
/// NaN.
pub(super) struct Around<'a> {
    /// Rows v - 3 to v + 3.
    pub(super) rows: [&'a [f32]; 7],
    /// Row v with three NaN on either side.
    pub(super) padded: &'a [f32],
    /// Standard deviations of row v.
    pub(super) sigma: &'a [f32],
    /// Variance of the coordinate due to model errors of the samples (rounded levels), in projector
    /// pixels^2.
    pub(super) model: f32,
    /// Maximum error that held projector pixels cause in an extrapolation to each pixel of row v.
    pub(super) held: &'a [f32],
    /// Period of the finest fringe in projector pixels; infinite without fringes.
    pub(super) finest: f32,
    /// Along rows and along columns: true if the image is longer than two pixels, so that a pixel
    /// without a neighbour on either side counts as isolated.
    pub(super) has_beside: [bool; 2],
}

/// Sets the flags of the row's mixed, too steep or isolated pixels to [`MIXED`], [`FINE`] or [`STRAY`]
/// where they are [`KEEP`]. Coordinates are known modulo `period`, which is 0 if they are absolute.
#[inline(always)]
pub(super) fn judge_row(around: &Around<'_>, period: f32, flags: &mut [u8]) {
    if period > 0.0 {
        judge::<true>(around, period, flags);
    } else {
        judge::<false>(around, 1.0, flags);
    }
}

#[inline(always)]
fn judge<const WRAPPED: bool>(around: &Around<'_>, period: f32, flags: &mut [u8]) {
    let n = flags.len();
    let h = |k: usize| &around.padded[k..k + n];
    let (l3, l2, l1, r1, r2, r3) = (h(0), h(1), h(2), h(4), h(5), h(6));
    let v = around.rows.map(|row| &row[..n]);
    let (sigma, held) = (&around.sigma[..n], &around.held[..n]);
    let span = SPAN * around.finest;
    let beside = around.has_beside;
    for i in 0..n {
        let x = v[3][i];
        let sigma = (sigma[i] * sigma[i] + around.model).sqrt();
        let base = NOISE * sigma + FLOOR_PX + held[i];
        let (left, right) = ([l1[i], l2[i], l3[i]], [r1[i], r2[i], r3[i]]);
        let (above, below) = ([v[2][i], v[1][i], v[0][i]], [v[4][i], v[5][i], v[6][i]]);
        let (row_bad, row_has) = line::<WRAPPED>(x, left, right, base, period);
        let (col_bad, col_has) = line::<WRAPPED>(x, above, below, base, period);
        // The smaller of the slopes on both sides, so that a depth step does not count as a slope.
        let step = |a: f32, b: f32| {
            let (a, b) = (less::<WRAPPED>(x, a, period), less::<WRAPPED>(x, b, period));
            a.abs().min(b.abs())
        };
        let (across, along) = (step(l1[i], r1[i]), step(v[2][i], v[4][i]));
        let fine = (across >= span) | (along >= span);
        let alone = (across.is_nan() & beside[0]) | (along.is_nan() & beside[1]);
        let stray = alone | !(row_has | col_has);
        let even = match (fine, stray) {
            (true, _) => FINE,
            (false, true) => STRAY,
            (false, false) => KEEP,
        };
        let verdict = if row_bad | col_bad { MIXED } else { even };
        flags[i] = if (flags[i] == KEEP) & !x.is_nan() {
            verdict
        } else {
            flags[i]
        };
    }
}

/// The difference a - b, reduced to the nearest period if coordinates are wrapped.
#[inline(always)]
pub(super) fn less<const WRAPPED: bool>(a: f32, b: f32, period: f32) -> f32 {
    let d = a - b;
    if WRAPPED {
        d - period * nearest(d / period)
    } else {
        d
    }
}

/// Returns `(outlier, tested)`: whether x disagrees with the extrapolations from both sides, and
/// whether any side could be extrapolated. Sides list the nearest pixel first; NaN marks missing
/// pixels.
#[inline(always)]
fn line<const WRAPPED: bool>(
    x: f32,
    left: [f32; 3],
    right: [f32; 3],
    base: f32,
    period: f32,
) -> (bool, bool) {
    // Slopes on either side, away from x.
    let (sl, sr) = (
        less::<WRAPPED>(left[0], left[1], period),
        less::<WRAPPED>(right[0], right[1], period),
    );
    let (bend_l, bend_r) = (
        less::<WRAPPED>(sl, less::<WRAPPED>(left[1], left[2], period), period),
        less::<WRAPPED>(sr, less::<WRAPPED>(right[1], right[2], period), period),
    );
    // Signed errors of the two extrapolations.
    let miss_l = less::<WRAPPED>(less::<WRAPPED>(x, left[0], period), sl, period);
    let miss_r = less::<WRAPPED>(less::<WRAPPED>(x, right[0], period), sr, period);
    let has_l = !miss_l.is_nan();
    let has_r = !miss_r.is_nan();
    // A crease: both extrapolations meet within the pixel, and the pixel's footprint averages over the
    // crease.
    let turn = (sl + sr).abs();
    let gap = less::<WRAPPED>(miss_l, miss_r, period).abs();
    let crease = if gap <= 0.75 * turn + base {
        0.2 * turn
    } else {
        0.0
    };
    // f32::max ignores NaN: an unknown curvature allows nothing.
    let allow_l = base + (2.0 * bend_l.abs()).min(0.5 * sl.abs()).max(0.0) + crease;
    let allow_r = base + (2.0 * bend_r.abs()).min(0.5 * sr.abs()).max(0.0) + crease;
    let ok = (miss_l.abs() <= allow_l) | (miss_r.abs() <= allow_r);
    let has = has_l | has_r;
    (has & !ok, has)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flags(x: &[f32], sigma: f32, period: f32) -> Vec<u8> {
        flags_with(x, sigma, period, f32::INFINITY)
    }

    fn flags_with(x: &[f32], sigma: f32, period: f32, finest: f32) -> Vec<u8> {
        flags_held(x, sigma, 0.0, period, finest)
    }

    fn flags_held(x: &[f32], sigma: f32, held: f32, period: f32, finest: f32) -> Vec<u8> {
        let nan = vec![f32::NAN; x.len()];
        let mut padded = vec![f32::NAN; 3];
        padded.extend(x);
        padded.extend([f32::NAN; 3]);
        let sigma = vec![sigma; x.len()];
        let around = Around {
            rows: [&nan, &nan, &nan, x, &nan, &nan, &nan],
            padded: &padded,
            sigma: &sigma,
            model: 0.0,
            held: &vec![held; x.len()],
            finest,
            has_beside: [x.len() > 2, false],
        };
        let mut flags = vec![KEEP; x.len()];
        judge_row(&around, period, &mut flags);
        flags
    }

    #[test]
    fn a_step_loses_its_mixed_pixel_only() {
        let x = [10.0, 14.0, 18.0, 22.0, 60.0, 104.0, 108.0, 112.0, 116.0];
        let mut truth = [KEEP; 9];
        truth[4] = MIXED;
        assert_eq!(flags(&x, 0.02, 0.0), truth);
        let wrapped = x.map(|v: f32| v.rem_euclid(16.0));
        let mut truth = [KEEP; 9];
        truth[4] = MIXED;
        assert_eq!(flags(&wrapped, 0.02, 16.0), truth);
    }

    #[test]
    fn keeps_steep_curved_and_creased_surfaces() {
        let sphere: Vec<f32> = (0..60).map(|i| 400.0 * (i as f32 / 60.0).asin()).collect();
        let crease: Vec<f32> = (0..20)
            .map(|i| {
                // Mean over the footprint of 4 |t| + 3 t, which has a crease within pixel 10.
                (0..100)
                    .map(|k| i as f32 - 10.2 + (k as f32 + 0.5) / 100.0)
                    .map(|t| (4.0 * t.abs() + 3.0 * t) / 100.0)
                    .sum()
            })
            .collect();
        for surface in [sphere, crease] {
            assert!(
                flags(&surface, 0.02, 0.0).iter().all(|&f| f == KEEP),
                "{surface:?}"
            );
        }
    }

    #[test]
    fn a_lone_wrong_period_goes_and_a_lone_pixel_is_stray() {
        let mut x: Vec<f32> = (0..12).map(|i| 4.0 * i as f32).collect();
        x[6] += 16.0;
        let found = flags(&x, 0.02, 0.0);
        assert_eq!((found[6], found[5], found[7]), (MIXED, KEEP, KEEP));
        let n = f32::NAN;
        assert_eq!(
            flags(&[n, 5.0, n, 1.0, n], 0.02, 0.0),
            [0, STRAY, 0, STRAY, 0]
        );
    }

    #[test]
    fn a_period_a_pixel_is_too_fine_and_a_step_is_not() {
        let steep: Vec<f32> = (0..9).map(|i| 17.0 * i as f32).collect();
        assert_eq!(flags_with(&steep, 0.02, 0.0, 16.0), [FINE; 9]);
        let less: Vec<f32> = (0..9).map(|i| 14.0 * i as f32).collect();
        assert_eq!(flags_with(&less, 0.02, 0.0, 16.0), [KEEP; 9]);
        let step = [4.0, 8.0, 12.0, 16.0, 80.0, 84.0, 88.0, 92.0];
        assert_eq!(flags_with(&step, 0.02, 0.0, 16.0), [KEEP; 8]);
    }

    #[test]
    fn keeps_line_of_pixels_without_known_slope_across() {
        let n = f32::NAN;
        let (nan, row) = ([n; 5], [n, n, 7.0, n, n]);
        let mut padded = vec![n; 3];
        padded.extend(row);
        padded.extend([n; 3]);
        for (has_beside, wanted) in [([true, true], STRAY), ([false, true], KEEP)] {
            let mut flags = vec![KEEP; 5];
            let around = Around {
                rows: [&nan, &row, &row, &row, &row, &row, &nan],
                padded: &padded,
                sigma: &[0.02; 5],
                model: 0.0,
                held: &[0.0; 5],
                finest: 16.0,
                has_beside,
            };
            judge_row(&around, 0.0, &mut flags);
            assert_eq!(flags, [KEEP, KEEP, wanted, KEEP, KEEP]);
        }
    }

    #[test]
    fn a_staircase_of_held_pixels_stays_and_a_stray_of_two_pixels_goes() {
        // Half a projector pixel per camera pixel, without blur: the mean of round(x) over the
        // footprint.
        let mean = |i: i32| -> f32 {
            let at = |k: i32| (0.5 * i as f32 + 0.3 + 0.05 * (k as f32 - 4.5)).round();
            (0..10).map(at).sum::<f32>() / 10.0
        };
        let mut x: Vec<f32> = (0..40).map(mean).collect();
        let flags = |x: &[f32]| flags_held(x, 0.005, 1.0, 0.0, f32::INFINITY);
        assert_eq!(flags(&x), [KEEP; 40]);
        x[20] += 2.5;
        assert_eq!(flags(&x)[20], MIXED);
    }

    #[test]
    fn a_partly_lit_border_pixel_goes() {
        // Only half of the last pixel is lit; the centre of that half is a quarter of a footprint
        // inwards.
        let x = [4.0, 8.0, 12.0, 16.0, 19.0, f32::NAN];
        assert_eq!(flags(&x, 0.02, 0.0), [0, 0, 0, 0, MIXED, 0]);
    }
}
