//! The range of pattern pixels under a kernel.
//!
//! Where the blur is wide, pattern pixels are averaged in groups of 2, 4, 8 and so on. A group is
//! never wider than 1/48 of sigma, which keeps the error of any pattern within 0.05 of 255 levels
//! (within 0.5 where the end of the pattern truncates the blur). This limits a kernel to a thousand
//! weights plus the footprint's width.

/// Number of SIMD lanes of the sum of products; the number of weights is a multiple of it.
pub(super) const LANES: usize = 8;
/// Maximum number of groups of a kernel. Without this limit, Gaussians of very different widths would
/// need more groups.
const MOST_GROUPS: f64 = 1024.0;
/// Number of group sizes: 2^0 to 2^10 pattern pixels.
pub(super) const GROUPINGS: usize = 11;

/// The pattern pixels, or groups of pattern pixels, under a kernel.
pub(super) struct Window {
    /// Indices of the first and the last group.
    pub(super) low: usize,
    pub(super) high: usize,
    /// Number of pattern pixels per group: 2^grouping.
    pub(super) group: f64,
    pub(super) grouping: usize,
    /// Distance of the footprint's centre from the left end of the pattern, in pattern pixels.
    pub(super) middle: f64,
    /// Distance from the footprint's centre that the kernel covers, in pattern pixels.
    pub(super) reach: f64,
}

impl Window {
    /// Returns the window on a row of `len` pixels around a footprint with centre `x` and half base
    /// width `outer`, whose blur reaches `beyond` further; `narrowest` is the standard deviation of
    /// the narrowest Gaussian.
    pub(super) fn new(len: usize, x: f32, outer: f64, beyond: f64, narrowest: f64) -> Self {
        let octaves = |ratio: f64| if ratio > 1.0 { ratio.log2() } else { 0.0 };
        let fine = octaves(narrowest / 48.0);
        let few = octaves(2.0 * beyond / MOST_GROUPS).ceil();
        let grouping = (fine.max(few) as usize).min(GROUPINGS - 1);
        let group = (1usize << grouping) as f64;
        let last = (len.div_ceil(1 << grouping) - 1) as f64;
        let middle = f64::from(x) + 0.5;
        let reach = outer + beyond;
        let place = |x: f64| (x / group).floor().clamp(0.0, last) as usize;
        Self {
            low: place(middle - reach),
            high: place(middle + reach),
            group,
            grouping,
            middle,
            reach,
        }
    }
}
