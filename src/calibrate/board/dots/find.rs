//! Finds the candidate dots, which are dark blobs on a lighter background, and fits an initial
//! ellipse to each.
//!
//! A pixel is dark if it is well below the mean of a square around it. The square is somewhat
//! larger than the grid's pitch, a distance over which uneven light changes little. Connected dark
//! pixels form a blob; its moments, weighted by darkness, give the initial ellipse of the fit.

use crate::board::BoardImage;
use glam::{DMat2, DVec2};

/// Minimum difference between a dark pixel and the mean around it, in standard deviations of the
/// pixel's noise.
const SURE: f64 = 5.0;
/// Minimum number of pixels of a blob.
const SMALLEST: u32 = 4;
/// Maximum ratio of a blob's axes: 60 degrees of tilt give 2, and a wide-angle lens adds to it.
const LONGEST: f64 = 6.0;
/// Maximum number of blobs kept, the heaviest first; the largest board has fewer dots.
const MOST: usize = 60_000;

/// A candidate dot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Blob {
    pub ellipse: Ellipse,
    /// Sum of darkness over the pixels: area in pixels times contrast.
    pub mass: f64,
}

#[derive(Debug, Clone, Copy)]
struct Run {
    from: u32,
    to: u32,
    parent: u32,
}

/// Moments of a blob's darkness, relative to the image's first pixel.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: u32,
    mass: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    cut: bool,
}

/// Finds blobs whose pixels are darker than `part` times the mean of the square of `side` x `side`
/// pixels around each pixel.
pub(super) fn find(image: &BoardImage, side: usize, part: f64) -> Vec<Blob> {
    let (width, height) = (image.width, image.height);
    let mut columns = ColumnSums::new(image, side / 2);
    let mut darkness = vec![0.0f32; width];
    let mut runs: Vec<Run> = Vec::new();
    let mut sums: Vec<Sums> = Vec::new();
    let mut above = 0..0;
    for v in 0..height {
        columns.row(v, part, &mut darkness);
        let first = runs.len();
        let mut u = 0;
        while u < width {
            if darkness[u] <= 0.0 {
                u += 1;
                continue;
            }
            let from = u;
            let mut sum = Sums {
                cut: v == 0 || v + 1 == height,
                ..Sums::default()
            };
            while u < width && darkness[u] > 0.0 {
                let (d, x, y) = (f64::from(darkness[u]), u as f64, v as f64);
                sum.count += 1;
                sum.mass += d;
                sum.x += d * x;
                sum.y += d * y;
                sum.xx += d * x * x;
                sum.xy += d * x * y;
                sum.yy += d * y * y;
                u += 1;
            }
            sum.cut |= from == 0 || u == width;
            runs.push(Run {
                from: from as u32,
                to: u as u32,
                parent: runs.len() as u32,
            });
            sums.push(sum);
        }
        join(&mut runs, above, first);
        above = first..runs.len();
    }
    gather(&mut runs, &sums)
}

/// Merges the runs from `first` on with the runs of the row above that they touch.
fn join(runs: &mut [Run], above: std::ops::Range<usize>, first: usize) {
    let mut up = above.start;
    for at in first..runs.len() {
        let here = runs[at];
        while up < above.end && runs[up].to <= here.from {
            up += 1;
        }
        let mut touching = up;
        while touching < above.end && runs[touching].from < here.to {
            let (a, b) = (top(runs, at as u32), top(runs, touching as u32));
            runs[a.max(b) as usize].parent = a.min(b);
            touching += 1;
        }
    }
}

/// Returns the root run of a blob (union-find with path halving).
fn top(runs: &mut [Run], mut at: u32) -> u32 {
    while runs[at as usize].parent != at {
        let up = runs[at as usize].parent;
        runs[at as usize].parent = runs[up as usize].parent;
        at = up;
    }
    at
}

fn gather(runs: &mut [Run], sums: &[Sums]) -> Vec<Blob> {
    let mut whole: Vec<Sums> = vec![Sums::default(); sums.len()];
    for (at, sum) in sums.iter().enumerate() {
        let to = &mut whole[top(runs, at as u32) as usize];
        to.count += sum.count;
        to.mass += sum.mass;
        to.x += sum.x;
        to.y += sum.y;
        to.xx += sum.xx;
        to.xy += sum.xy;
        to.yy += sum.yy;
        to.cut |= sum.cut;
    }
    let mut blobs: Vec<Blob> = whole.iter().filter_map(blob).collect();
    if blobs.len() > MOST {
        blobs.sort_by(|a, b| b.mass.total_cmp(&a.mass));
        blobs.truncate(MOST);
    }
    blobs
}

fn blob(sum: &Sums) -> Option<Blob> {
    if sum.count < SMALLEST || sum.cut || !(sum.mass > 0.0) {
        return None;
    }
    let centre = DVec2::new(sum.x, sum.y) / sum.mass;
    let (xx, xy, yy) = (
        sum.xx / sum.mass - centre.x * centre.x,
        sum.xy / sum.mass - centre.x * centre.y,
        sum.yy / sum.mass - centre.y * centre.y,
    );
    // The second moment of a disc is a quarter of its radius squared; that of a pixel, 1/12.
    let moments = DMat2::from_cols(DVec2::new(xx, xy), DVec2::new(xy, yy));
    let ellipse = Ellipse {
        centre,
        shape: 2.0
            * root(
                moments - DMat2::from_diagonal(DVec2::splat(1.0 / 12.0)),
                0.25,
            ),
    };
    let [small, large] = ellipse.half_axes();
    let filled = f64::from(sum.count) / (std::f64::consts::PI * ellipse.size());
    // Pixels on the outline are partly dark, so a small blob has more pixels than its ellipse has
    // area.
    let fullest = 1.5 + 2.0 / small;
    (ellipse.is_sound() && large <= LONGEST * small && filled > 0.6 && filled < fullest).then_some(
        Blob {
            ellipse,
            mass: sum.mass,
        },
    )
}

/// Column sums over a band of rows that moves down the image.
struct ColumnSums<'a> {
    image: &'a BoardImage,
    half: usize,
    sums: Vec<f64>,
    counts: Vec<f64>,
    /// Rows included in the sums.
    band: std::ops::Range<usize>,
}

impl<'a> ColumnSums<'a> {
    fn new(image: &'a BoardImage, half: usize) -> Self {
        Self {
            image,
            half,
            sums: vec![0.0; image.width],
            counts: vec![0.0; image.width],
            band: 0..0,
        }
    }

    fn add(&mut self, row: usize, sign: f64) {
        let width = self.image.width;
        let levels = &self.image.level[row * width..][..width];
        for ((sum, count), &level) in self.sums.iter_mut().zip(&mut self.counts).zip(levels) {
            let known = level.is_finite();
            *sum += if known { sign * f64::from(level) } else { 0.0 };
            *count += if known { sign } else { 0.0 };
        }
    }

    /// Computes the darkness of a row's pixels relative to the paper's level; 0 where a pixel is
    /// not dark.
    fn row(&mut self, v: usize, part: f64, darkness: &mut [f32]) {
        let (width, height) = (self.image.width, self.image.height);
        while self.band.end < (v + self.half + 1).min(height) {
            self.add(self.band.end, 1.0);
            self.band.end += 1;
        }
        while self.band.start + self.half < v {
            self.add(self.band.start, -1.0);
            self.band.start += 1;
        }
        let levels = &self.image.level[v * width..][..width];
        let variances = &self.image.variance[v * width..][..width];
        let (mut sum, mut count) = (0.0, 0.0);
        for u in 0..(self.half).min(width) {
            sum += self.sums[u];
            count += self.counts[u];
        }
        for u in 0..width {
            if let Some(enters) = self.sums.get(u + self.half) {
                sum += enters;
                count += self.counts[u + self.half];
            }
            if u > self.half {
                sum -= self.sums[u - self.half - 1];
                count -= self.counts[u - self.half - 1];
            }
            let mean = sum / f64::max(count, 1.0);
            let level = f64::from(levels[u]);
            let below = mean * part - level;
            let noise = SURE * SURE * f64::from(variances[u]);
            // Dots lower the mean to about 1 / 1.15 of the paper's level.
            let paper = 1.15 * mean;
            let dark = below > 0.0 && (mean - level) * (mean - level) > noise;
            darkness[u] = if dark {
                ((paper - level) / paper) as f32
            } else {
                0.0
            };
        }
    }
}

/// An ellipse: the unit circle transformed by a symmetric, positive matrix, about a centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ellipse {
    /// In pixels.
    pub centre: DVec2,
    /// In pixels.
    pub shape: DMat2,
}

impl Ellipse {
    /// Half the width and height of the bounding box.
    pub fn reach(&self) -> DVec2 {
        DVec2::new(self.shape.x_axis.length(), self.shape.y_axis.length())
    }

    /// Semi-axes in pixels, the smaller first.
    pub fn half_axes(&self) -> [f64; 2] {
        let (mean, half, off) = (
            0.5 * (self.shape.x_axis.x + self.shape.y_axis.y),
            0.5 * (self.shape.x_axis.x - self.shape.y_axis.y),
            self.shape.x_axis.y,
        );
        let spread = half.hypot(off);
        [mean - spread, mean + spread]
    }

    /// Area in units of pi pixels.
    pub fn size(&self) -> f64 {
        self.shape.determinant()
    }

    /// Returns the ellipse with both semi-axes longer by `px`.
    pub fn wider(&self, px: f64) -> Self {
        Self {
            centre: self.centre,
            shape: self.shape + DMat2::from_diagonal(DVec2::splat(px)),
        }
    }

    /// Whether the ellipse is finite and not degenerate.
    pub fn is_sound(&self) -> bool {
        let [small, large] = self.half_axes();
        self.centre.is_finite() && small > 0.05 && large.is_finite()
    }

    /// Returns a function that maps a pixel position to a value below 1 inside the ellipse and
    /// above 1 outside.
    pub fn inward(&self) -> impl Fn(DVec2) -> f64 + use<> {
        let (centre, inverse) = (self.centre, self.shape.inverse());
        move |px| (inverse * (px - centre)).length_squared()
    }
}

/// Symmetric square root of a symmetric, positive matrix, by the Cayley-Hamilton theorem. Adds a
/// multiple of the identity if needed, so that the root's eigenvalues are at least `least`.
pub(super) fn root(m: DMat2, least: f64) -> DMat2 {
    let m = {
        let [small, _] = Ellipse {
            centre: DVec2::ZERO,
            shape: m,
        }
        .half_axes();
        let lift = (least * least - small).max(0.0);
        m + DMat2::from_diagonal(DVec2::splat(lift))
    };
    let product = m.determinant().max(0.0).sqrt();
    let sum = (m.x_axis.x + m.y_axis.y + 2.0 * product).sqrt();
    (m + DMat2::from_diagonal(DVec2::splat(product))) * (1.0 / sum)
}

/// A rectangle of pixels: columns from `left`, rows from `top`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    pub left: usize,
    pub top: usize,
    pub width: usize,
    pub height: usize,
}

impl Window {
    /// Returns the window of pixels within `reach` of `centre`, clipped to an image of `width` x
    /// `height`; `None` if the window is empty.
    pub fn about(centre: DVec2, reach: DVec2, width: usize, height: usize) -> Option<Self> {
        if !(centre.is_finite() && reach.is_finite()) {
            return None;
        }
        let range = |middle: f64, reach: f64, size: usize| {
            let first = (middle - reach).ceil().max(0.0);
            let last = (middle + reach).floor().min(size as f64 - 1.0);
            (last >= first).then(|| (first as usize, last as usize - first as usize + 1))
        };
        let (left, columns) = range(centre.x, reach.x, width)?;
        let (top, rows) = range(centre.y, reach.y, height)?;
        Some(Self {
            left,
            top,
            width: columns,
            height: rows,
        })
    }

    /// Positions of the window's pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = DVec2> + use<> {
        let Self {
            left,
            top,
            width,
            height,
        } = *self;
        (top..top + height)
            .flat_map(move |v| (left..left + width).map(move |u| DVec2::new(u as f64, v as f64)))
    }
}
