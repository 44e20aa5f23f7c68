//! Fringe orders: selects among positions that look alike and decides whether the choice is
//! certain.

use super::gray::{GrayRow, cells};
use super::turns::nearest;

/// Noise margin, in standard deviations, that a decision needs on either side.
pub(super) const SURE: f32 = 4.0;
/// Minimum difference in chi squared between the best candidate and the next.
const GAP: f32 = 25.0;
/// Fraction of the full contrast below which the pixel counts as lying on the bit's edge.
const EDGE_CONTRAST: f32 = 0.25;
/// Fraction of the full contrast below which two bits of a pixel cannot come from one place. Code words
/// of neighbouring cells differ in one bit, so a pixel that sees one surface has at most one bit between
/// black and white while its footprint is no wider than a cell. Two bits fall below half of the contrast
/// only if the footprint spans two cells; such a pixel cannot resolve fringes as wide as a cell.
pub(super) const TWO_PLACES: f32 = 0.5;
/// Maximum misfit of a fringe set, as a fraction of its period, if there is only one candidate.
const MISFIT: f32 = 0.15;
/// Search range on either side of a set's positions, in standard deviations: a candidate beyond this
/// range cannot compete with a candidate that only noise has displaced.
const SPREAD: f32 = 8.0;
/// Fraction of a cell by which a phase may lie beyond its cell's edge, whichever bit is the weakest:
/// response curves displace phases by that much.
const OFF_CELL: f32 = 0.0625;

/// Candidates of one or several fringe sets over a range of positions.
#[derive(Debug, Clone)]
pub(super) struct Ensemble {
    periods: Vec<f32>,
}

impl Ensemble {
    /// Creates the ensemble of fringe sets with these periods in projector pixels, finest first.
    pub(super) fn new(periods: Vec<f32>) -> Self {
        Self { periods }
    }

    /// Given each set's wrapped coordinate and variance, returns the maximum-likelihood position in
    /// [lo, hi), with its own variance and whether it is certain.
    ///
    /// The candidates are the finest set's; each is moved to the inverse-variance mean of all
    /// sets' nearest positions, and its cost is the weighted sum of squares that remains.
    #[inline(always)]
    pub(super) fn best(&self, wrapped: &[f32], variance: &[f32], lo: f32, hi: f32) -> Candidate {
        // Only candidates near all sets' positions matter if the best one is good enough: a candidate
        // outside its reach of a set's position costs at least the square of the reach over both
        // variances. If there are no errors besides noise, one or two candidates are evaluated; with
        // larger errors a few; in the worst case all.
        let spread = |j: usize| SPREAD * (variance[j] + variance[0]).sqrt();
        let wide = |j: usize| spread(j).max(MISFIT * self.periods[j]);
        if let Some(found) = self.within(wrapped, variance, [lo, hi], spread) {
            return found;
        }
        if let Some(found) = self.within(wrapped, variance, [lo, hi], wide) {
            return found;
        }
        let half = |j: usize| 0.5 * self.periods[j];
        self.among(wrapped, variance, [lo, hi], half)
            .found(f32::INFINITY)
    }

    /// Searches like [`Self::best`], but only among candidates within a reach of each set's
    /// positions; `None` if this may give another result than [`Self::best`].
    #[inline(always)]
    fn within(
        &self,
        wrapped: &[f32],
        variance: &[f32],
        range: [f32; 2],
        reach: impl Fn(usize) -> f32,
    ) -> Option<Candidate> {
        let mut beyond = f32::INFINITY;
        for j in 1..self.periods.len() {
            if reach(j) < 0.5 * self.periods[j] {
                beyond = beyond.min(reach(j) * reach(j) / (variance[j] + variance[0]));
            }
        }
        if beyond == f32::INFINITY {
            return None;
        }
        let search = self.among(wrapped, variance, range, reach);
        let found = search.found(beyond);
        // Stop if no other candidate can win, or if the second best candidate already makes the best one
        // uncertain.
        let settled = search.best.0 < beyond
            && search.second.is_finite()
            && !search.is_certain(search.second);
        (found.certain || settled).then_some(found)
    }

    /// Evaluates candidates within a reach of each set's positions.
    #[inline(always)]
    fn among<'a>(
        &'a self,
        wrapped: &'a [f32],
        variance: &'a [f32],
        [lo, hi]: [f32; 2],
        reach: impl Fn(usize) -> f32,
    ) -> Search<'a> {
        let mut search = Search {
            periods: &self.periods,
            wrapped,
            variance,
            total: variance.iter().map(|v| 1.0 / v).sum(),
            best: (f32::INFINITY, 0.0, 0.0),
            second: f32::INFINITY,
        };
        search.coarse(self.periods.len() - 1, lo, hi, &reach);
        search
    }
}

/// The state of a search.
struct Search<'a> {
    periods: &'a [f32],
    wrapped: &'a [f32],
    variance: &'a [f32],
    /// Sum of inverse variances.
    total: f32,
    /// Cost, position and worst misfit of the best candidate.
    best: (f32, f32, f32),
    /// Cost of the second best candidate.
    second: f32,
}

impl Search<'_> {
    /// Searches `lo` to `hi` where set `j` and all finer sets allow candidates. Two and three sets, the
    /// usual numbers, need no recursion.
    #[inline(always)]
    fn coarse(&mut self, j: usize, lo: f32, hi: f32, reach: &impl Fn(usize) -> f32) {
        match j {
            0 => self.fine(lo, hi),
            1 => self.near(1, lo, hi, reach, |s, lo, hi| s.fine(lo, hi)),
            2 => self.near(2, lo, hi, reach, |s, lo, hi| {
                s.near(1, lo, hi, reach, |s, lo, hi| s.fine(lo, hi));
            }),
            _ => self.coarser(j, lo, hi, reach),
        }
    }

    fn coarser(&mut self, j: usize, lo: f32, hi: f32, reach: &impl Fn(usize) -> f32) {
        match j {
            0 => self.fine(lo, hi),
            _ => self.near(j, lo, hi, reach, |s, lo, hi| {
                s.coarser(j - 1, lo, hi, reach);
            }),
        }
    }

    /// Calls `then` on each range between `lo` and `hi` that set `j` allows.
    #[inline(always)]
    fn near(
        &mut self,
        j: usize,
        lo: f32,
        hi: f32,
        reach: &impl Fn(usize) -> f32,
        then: impl Fn(&mut Self, f32, f32),
    ) {
        let (p, x, near) = (self.periods[j], self.wrapped[j], reach(j));
        if near >= 0.5 * p {
            return then(self, lo, hi);
        }
        let mut m = ceil((lo - x - near) / p);
        while x + m * p - near < hi {
            let middle = x + m * p;
            then(self, (middle - near).max(lo), (middle + near).min(hi));
            m += 1.0;
        }
    }

    /// Evaluates every candidate of the finest set from `lo` to `hi`.
    #[inline(always)]
    fn fine(&mut self, lo: f32, hi: f32) {
        let (p0, x0) = (self.periods[0], self.wrapped[0]);
        let mut k = ceil((lo - x0) / p0);
        while x0 + k * p0 < hi {
            let x = x0 + k * p0;
            let (mut sum, mut squares, mut misfit) = (0.0, 0.0, 0.0_f32);
            for j in 1..self.periods.len() {
                let (d, p) = (self.wrapped[j] - x, self.periods[j]);
                let d = d - p * nearest(d / p);
                sum += d / self.variance[j];
                squares += d * d / self.variance[j];
                misfit = misfit.max(d.abs() / p);
            }
            let cost = squares - sum * sum / self.total;
            if cost < self.best.0 {
                self.second = self.second.min(self.best.0);
                self.best = (cost, x + sum / self.total, misfit);
            } else {
                self.second = self.second.min(cost);
            }
            k += 1.0;
        }
    }

    /// Returns the best candidate, given that every candidate that was not evaluated costs at least
    /// `beyond`.
    fn found(&self, beyond: f32) -> Candidate {
        Candidate {
            x: self.best.1,
            variance: 1.0 / self.total,
            certain: self.is_certain(self.second.min(beyond)),
        }
    }

    /// Returns whether the best candidate is certain, given the cost of another.
    fn is_certain(&self, second: f32) -> bool {
        let (cost, _, misfit) = self.best;
        // Errors other than noise (response curves, defocus) grow with the period, so the best
        // candidate's misfit must also be less than half that of the next, whatever the noise.
        if second.is_finite() {
            second - cost >= GAP && cost <= 0.25 * second
        } else {
            cost.is_finite() && misfit <= MISFIT
        }
    }
}

/// Rounds up a number smaller than 2^22 in magnitude; not every x86 processor has an instruction
/// for it.
#[inline(always)]
fn ceil(v: f32) -> f32 {
    let whole = nearest(v);
    if whole < v { whole + 1.0 } else { whole }
}

/// Result of [`Ensemble::best`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) x: f32,
    pub(super) variance: f32,
    pub(super) certain: bool,
}

/// Combines Gray code with a coordinate known modulo `repeat`.
#[derive(Debug, Clone, Copy)]
pub(super) struct GrayJoin {
    /// Cell width in projector pixels.
    pub(super) cell: f32,
    /// Repeat of the fringes in projector pixels; far beyond the axis if they do not repeat.
    pub(super) repeat: f32,
    /// Ratio of the standard deviation of a bit's contrast to that of one sample.
    pub(super) noise_factor: f32,
}

impl GrayJoin {
    /// Returns the combination without the code's finest bits.
    pub(super) fn without(self, bits: usize) -> Self {
        Self {
            cell: self.cell * (bits as f32).exp2(),
            ..self
        }
    }

    /// Returns the centre of the cell with this code. A code edge lies half a pixel before the
    /// first pixel of its cell.
    #[inline(always)]
    pub(super) fn center(&self, code: u32) -> f32 {
        cells(code).0 as f32 * self.cell + 0.5 * self.cell - 0.5
    }

    /// Returns whether the two weakest bits show that a pixel sees two places at once, as at a
    /// silhouette. The fringes of one place may be too fine to resolve, so that the phase comes from the
    /// other place. Low contrast that noise can explain does not count.
    #[inline(always)]
    fn two_places(second: f32, half: f32, doubt: f32) -> bool {
        (second < TWO_PLACES * half) & (second + doubt < half)
    }

    /// Moves `x`, known modulo the repeat, into its Gray cell; clears `ok` where weak bits make the
    /// cell uncertain.
    ///
    /// A bit is weak if its contrast is within [`SURE`] standard deviations or a quarter of the full
    /// contrast of its threshold. Without weak bits, x becomes the repeat nearest to the cell's centre.
    /// With one weak bit, the pixel may equally lie in the cell on the other side of that bit's edge: if
    /// the two cells touch, x becomes the repeat nearest to their common edge. If this repeat differs
    /// from the repeat nearest to the cell's centre (with cells as wide as the repeat), it is accepted
    /// only if noise could not have made the bit weak. All other cases are uncertain.
    #[inline(always)]
    pub(super) fn join(
        &self,
        gray: &GrayRow,
        x: &mut [f32],
        variance: &[f32],
        half_contrast: &[f32],
        sigma: &[f32],
        ok: &mut [bool],
    ) {
        let n = x.len();
        let code = &gray.code[..n];
        let (margin, second) = (&gray.margin[..n], &gray.second[..n]);
        let (variance, half) = (&variance[..n], &half_contrast[..n]);
        let (sigma, ok) = (&sigma[..n], &mut ok[..n]);
        let (p, cell) = (self.repeat, self.cell);
        let window = (0.5 * p).min(cell);
        let limit = 0.5 * cell + 0.5 * (window - 0.5 * cell);
        for i in 0..n {
            let (here, there) = cells(code[i]);
            let center = here as f32 * cell + 0.5 * cell - 0.5;
            let edge = here.max(there) as f32 * cell - 0.5;
            let touching = here.max(there) - here.min(there) == 1;
            let doubt = SURE * sigma[i] * self.noise_factor;
            let weak_below = (EDGE_CONTRAST * half[i]).max(doubt);
            let guard = 0.5 * p - SURE * variance[i].sqrt();
            let at_center = x[i] + p * nearest((center - x[i]) / p);
            let at_edge = x[i] + p * nearest((edge - x[i]) / p);
            let (from_center, from_edge) = ((at_center - center).abs(), (at_edge - edge).abs());
            // If x lies beyond an edge of its cell, the weakest bit must be the bit of that edge.
            let beyond = (from_center > 0.5 * cell + OFF_CELL * cell)
                & !(touching & ((at_center > center) == (edge > center)));
            let strong_ok = (from_center <= limit.min(guard)) & !beyond;
            let same = (at_edge - at_center).abs() < 0.5 * p;
            let sound = half[i] - weak_below > doubt;
            let edge_ok =
                (same & (from_center.max(from_edge) <= guard)) | (sound & (from_edge <= 0.125 * p));
            let one_weak = margin[i] < weak_below;
            let two_weak = second[i] < weak_below;
            let good = if one_weak {
                touching & !two_weak & edge_ok
            } else {
                strong_ok
            };
            x[i] = if one_weak { at_edge } else { at_center };
            ok[i] &= good & !Self::two_places(second[i], half[i], doubt);
        }
    }

    /// Gray code without fringes: the centre of the cell, or the edge between two cells if one bit is
    /// weak.
    #[inline(always)]
    pub(super) fn cells(
        &self,
        gray: &GrayRow,
        x: &mut [f32],
        half_contrast: &[f32],
        sigma: &[f32],
        ok: &mut [bool],
    ) {
        for i in 0..x.len() {
            let (here, there) = cells(gray.code[i]);
            let doubt = SURE * sigma[i] * self.noise_factor;
            let weak_below = (EDGE_CONTRAST * half_contrast[i]).max(doubt);
            let one_weak = gray.margin[i] < weak_below;
            let two_weak = gray.second[i] < weak_below;
            let touching = here.max(there) - here.min(there) == 1;
            x[i] = if one_weak {
                here.max(there) as f32 * self.cell - 0.5
            } else {
                self.center(gray.code[i])
            };
            let two_places = Self::two_places(gray.second[i], half_contrast[i], doubt);
            ok[i] &= (!one_weak | (touching & !two_weak)) & !two_places;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_periods_find_every_position() {
        let periods = [16.0f32, 160.0, 1920.0];
        let ensemble = Ensemble::new(periods.to_vec());
        for i in 0..19_180 {
            let x = 0.5 + i as f32 * 0.1;
            let wrapped = periods.map(|p| x.rem_euclid(p));
            let best = ensemble.best(&wrapped, &[4e-4, 0.04, 6.0], -1.5, 1920.5);
            assert!((best.x - x).abs() < 1e-3 && best.certain, "{x} {best:?}");
        }
    }

    /// Candidates far from some set's positions are skipped only if they could not win.
    #[test]
    fn pruned_search_finds_the_same_as_full_search() {
        let periods = [10.0f32, 96.0, 960.0];
        let ensemble = Ensemble::new(periods.to_vec());
        let (mut certain, mut state) = (0, 1u32);
        let mut draw = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        for _ in 0..20_000 {
            let x = 456.0 + 900.0 * draw();
            let noise = 0.04 * draw().abs();
            let wrapped = periods.map(|p| (x + 4.0 * noise * p * draw()).rem_euclid(p));
            let variance = periods.map(|p| (noise * p).powi(2) + 1e-4);
            let found = ensemble.best(&wrapped, &variance, -1.5, 912.5);
            let half = |j: usize| 0.5 * periods[j];
            let all = ensemble.among(&wrapped, &variance, [-1.5, 912.5], half);
            let all = all.found(f32::INFINITY);
            assert_eq!(
                (found.certain, found.x),
                (all.certain, all.x),
                "{x} {noise}"
            );
            certain += usize::from(found.certain);
        }
        assert!((2_000..19_000).contains(&certain), "{certain}");
    }

    /// Joins bits of these contrasts with a fringe phase at 700 px; cells and fringes are 16 px wide,
    /// and samples have noise of 1 DN.
    fn joined(bits: &[f32], half: f32) -> (f32, bool) {
        let mut gray = GrayRow::default();
        gray.reset(1);
        for (bit, contrast) in bits.iter().enumerate() {
            gray.add_single(bit, &[0u8], &[-contrast], 1.0);
        }
        let join = GrayJoin {
            cell: 16.0,
            repeat: 16.0,
            noise_factor: 1.2,
        };
        let (mut x, mut ok) = ([700.0_f32.rem_euclid(16.0)], [true]);
        join.join(&gray, &mut x, &[1e-3], &[half], &[1.0], &mut ok);
        (x[0], ok[0])
    }

    /// Contrasts of the bits of a cell's code word.
    fn word(cell: u64, half: f32) -> [f32; 7] {
        let code = phasmid_pattern::gray_encode(cell);
        std::array::from_fn(|bit| if code >> bit & 1 == 1 { half } else { -half })
    }

    #[test]
    fn a_pixel_that_sees_two_places_is_refused_and_one_on_an_edge_is_not() {
        let (here, half) = (700 / 16, 40.0);
        assert_eq!(joined(&word(here, half), half), (700.0, true));
        // A mixture with the next cell, whose word differs in one bit.
        let mixed = |other: u64, share: f32| {
            let (a, b) = (word(here, half), word(other, half));
            std::array::from_fn::<f32, 7, _>(|i| a[i] * (1.0 - share) + b[i] * share)
        };
        assert!(joined(&mixed(here + 1, 0.3), half).1);
        // A mixture with a distant cell, whose word differs in several bits, at a third of the light.
        let far = (0..120).filter(|&cell| {
            let differ = phasmid_pattern::gray_encode(cell) ^ phasmid_pattern::gray_encode(here);
            differ.count_ones() >= 2
        });
        for cell in far {
            assert!(!joined(&mixed(cell, 0.3), half).1, "{cell}");
            assert!(joined(&mixed(cell, 0.1), half).1, "{cell}");
        }
        // Low contrast that noise can explain is no evidence of two places.
        assert!(!GrayJoin::two_places(1.5, 4.0, 6.0));
        assert!(GrayJoin::two_places(12.0, 40.0, 6.0));
    }

    #[test]
    fn a_tie_is_uncertain_and_so_is_the_seam_of_a_single_period() {
        // Periods of 66.67 px and 100 px repeat together after 200 px.
        let ensemble = Ensemble::new(vec![200.0 / 3.0, 100.0]);
        let wrapped = [50.0, 50.0];
        assert!(ensemble.best(&wrapped, &[0.01, 0.01], 0.0, 200.0).certain);
        assert!(!ensemble.best(&wrapped, &[0.01, 0.01], 0.0, 400.0).certain);
        let one = Ensemble::new(vec![1920.0]);
        assert!(one.best(&[700.0], &[0.01], -1.5, 1920.5).certain);
        assert!(!one.best(&[0.2], &[0.01], -1.5, 1920.5).certain);
    }
}
