//! Measures dots: first estimates the image's blur and contrast from a sample, then fits every dot.

use super::coverage::{self, Cell as Covered, Steps};
use super::find::{Ellipse, Window};
use super::fit::{Fit, Known, Patch, fit};
use super::lattice::{Cell, Dot, Dots};
use crate::board::BoardImage;
use phasmid_core::statistics::finite_median;
use rayon::prelude::*;

/// The fit of a dot uses a ring of paper around it. This is the width of that ring in pixels; three
/// standard deviations of the blur are added to it.
const RING: f64 = 3.0;
/// Approximate number of dots that the blur is estimated from.
const SAMPLES: usize = 32;
/// Assumed standard deviation of the ink's contrast between the dots of a board.
const INK_SPREAD: f64 = 0.1;
/// Dots are taken to have different blurs if the upper quartile of their differences from the
/// median blur, in standard deviations, exceeds this. Noise alone gives 1.15.
const VARIES: f64 = 3.0;
/// Blur variance, in pixels squared, above which a dot's blurred edge noticeably darkens the paper
/// around neighbouring dots.
const WIDE: f64 = 0.1;

/// An image with the blur and contrast that all its dots share.
pub(super) struct Measure<'a> {
    pub image: &'a BoardImage,
    pub steps: Steps,
    /// Variance of the blur in pixels squared.
    pub blur: f64,
    known: Known,
}

impl<'a> Measure<'a> {
    /// Estimates blur and contrast from the markers and a sample of other dots, then fits every
    /// known dot.
    pub fn new(image: &'a BoardImage, dots: &mut Dots) -> Self {
        let mut this = Self {
            image,
            steps: Steps::new(),
            blur: 0.1,
            known: Known {
                blur: None,
                contrast: None,
            },
        };
        let cells: Vec<Cell> = dots.known.keys().copied().collect();
        this.estimate(dots, false);
        this.take(dots, &cells, false);
        if this.blur > WIDE {
            // The neighbours' outlines are known now, so that their blurred edges can be modelled.
            this.estimate(dots, true);
            let crowded: Vec<Cell> = cells
                .into_iter()
                .filter(|&cell| this.is_crowded(dots, cell))
                .collect();
            for _ in 0..2 {
                this.take(dots, &crowded, true);
            }
        }
        this
    }

    /// Whether a neighbour's blur reaches into a dot's patch, or the dot has no fit yet.
    fn is_crowded(&self, dots: &Dots, cell: Cell) -> bool {
        dots.known.get(&cell).is_some_and(|dot| {
            let field = self.field(&dot.ellipse());
            let reach = self.reach(true);
            let mut around = dots.around(cell, 2);
            dot.fit.is_none() || around.any(|(_, n)| near(&field, &n.ellipse(), reach))
        })
    }

    /// Region that a dot's patch covers.
    fn field(&self, dot: &Ellipse) -> Ellipse {
        dot.wider(RING + 3.0 * self.blur.sqrt())
    }

    /// Distance in pixels beyond a dot's outline within which the dot darkens the paper noticeably.
    /// Farther out, the effect is negligible (`overlapping`) or small enough for the fit of a
    /// neighbouring dot to tolerate.
    fn reach(&self, overlapping: bool) -> f64 {
        let sigma = self.blur.sqrt();
        if overlapping {
            0.5 + 3.5 * sigma
        } else {
            0.75 + 1.5 * sigma
        }
    }

    fn estimate(&mut self, dots: &Dots, overlapping: bool) {
        self.known.blur = None;
        let every = dots.known.len().div_ceil(SAMPLES).max(1);
        let sample: Vec<Cell> = dots
            .known
            .keys()
            .enumerate()
            .filter(|&(k, &cell)| {
                k % every == 0 || dots.index(cell).is_some_and(|i| dots.board.is_marker(i))
            })
            .map(|(_, &cell)| cell)
            .collect();
        let fits: Vec<Fit> = self
            .fits(dots, &sample, overlapping)
            .into_iter()
            .flatten()
            .filter(|fit| fit.told > 0.8)
            .collect();
        let blurs = fits
            .iter()
            .map(|fit| (fit.model.blur, 1.0 / fit.blur_variance.sqrt()))
            .collect();
        self.blur = weighted_median(blurs).unwrap_or(0.0);
        // Parts of the image may be out of focus, so that each dot has its own blur.
        let off = |fit: &Fit| (fit.model.blur - self.blur).abs();
        let beyond_noise = |fit: &Fit| off(fit) / (fit.blur_variance * fit.chi2.max(1.0)).sqrt();
        let upper = |value: &dyn Fn(&Fit) -> f64| {
            let mut values: Vec<f64> = fits.iter().map(value).filter(|v| v.is_finite()).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() * 3 / 4).copied()
        };
        let spread = match (upper(&off), upper(&beyond_noise)) {
            (Some(off), Some(z)) if z > VARIES => 2.0 * off,
            _ => 0.0,
        };
        if self.blur < coverage::SHARP * 1.5 && spread == 0.0 {
            self.blur = 0.0;
        }
        self.known = Known {
            blur: Some([self.blur, spread]),
            contrast: finite_median(fits.iter().map(|fit| fit.model.contrast))
                .map(|contrast| [contrast, INK_SPREAD]),
        };
    }

    fn take(&self, dots: &mut Dots, cells: &[Cell], overlapping: bool) {
        let fits = self.fits(dots, cells, overlapping);
        for (cell, fit) in cells.iter().zip(fits) {
            if let Some(dot) = dots.known.get_mut(cell) {
                dot.fit = fit;
            }
        }
    }

    /// Fits dots, starting from their known outlines. With `overlapping`, the model includes the
    /// darkening by neighbours' blurred edges; without it, pixels that neighbours darken are
    /// excluded.
    fn fits(&self, dots: &Dots, cells: &[Cell], overlapping: bool) -> Vec<Option<Fit>> {
        cells
            .par_iter()
            .with_min_len(8)
            .map_init(Vec::new, |scratch, cell| {
                let dot = dots.known.get(cell)?;
                // The outline of a blob that could not be fitted includes its blur, so take the
                // outline that the neighbours predict.
                let start = match (&dot.fit, overlapping) {
                    (None, true) => dots.outline(*cell, dot.start.centre)?,
                    _ => dot.ellipse(),
                };
                self.one(dots, *cell, start, overlapping, scratch)
            })
            .collect()
    }

    /// Fits a dot where one is expected; `start` is its predicted outline.
    pub fn try_at(&self, dots: &Dots, cell: Cell, start: Ellipse) -> Option<Dot> {
        let mut scratch = Vec::new();
        let fit = self.one(dots, cell, start, false, &mut scratch)?;
        Some(Dot {
            start,
            fit: Some(fit),
        })
    }

    fn one(
        &self,
        dots: &Dots,
        cell: Cell,
        start: Ellipse,
        overlapping: bool,
        scratch: &mut Vec<Covered>,
    ) -> Option<Fit> {
        let neighbours: Vec<Ellipse> = dots.around(cell, 2).map(|(_, dot)| dot.ellipse()).collect();
        let patch = self.patch(start, &neighbours, overlapping, scratch)?;
        fit(&patch, start, &self.known, &self.steps, scratch)
    }

    /// Cuts out the pixels of a dot and of the paper around it.
    fn patch(
        &self,
        dot: Ellipse,
        neighbours: &[Ellipse],
        overlapping: bool,
        scratch: &mut Vec<Covered>,
    ) -> Option<Patch> {
        let BoardImage {
            width,
            height,
            level,
            variance,
        } = self.image;
        let field = self.field(&dot);
        let window = Window::about(dot.centre, field.reach(), *width, *height)?;
        let rows = || (window.top..window.top + window.height).map(|v| v * width + window.left);
        let level: Vec<f64> = rows()
            .flat_map(|from| &level[from..from + window.width])
            .map(|&l| f64::from(l))
            .collect();
        let variance = rows().flat_map(|from| &variance[from..from + window.width]);
        let highest = level.iter().copied().fold(0.0, f64::max);
        // Below this noise, errors of the model dominate (Gaussian blur, light as a plane).
        let least = (3e-4 * highest).powi(2).max(f64::MIN_POSITIVE);
        let inside = field.inward();
        // If the model includes the neighbours' blurred edges, exclude only pixels on the
        // neighbours' ink.
        let reach = self.reach(overlapping);
        let margin = if overlapping { 0.3 } else { reach };
        let near: Vec<_> = neighbours
            .iter()
            .filter(|n| near(&field, n, reach))
            .collect();
        let beside: Vec<_> = near.iter().map(|n| n.wider(margin).inward()).collect();
        let weight = window
            .pixels()
            .zip(level.iter().zip(variance))
            .map(|(px, (l, &v))| {
                let v = f64::from(v);
                let counts = l.is_finite()
                    && v.is_finite()
                    && v >= 0.0
                    && inside(px) <= 1.0
                    && beside.iter().all(|theirs| theirs(px) > 1.0);
                if counts { 1.0 / v.max(least) } else { 0.0 }
            })
            .collect();
        let mut others = vec![0.0; level.len()];
        if overlapping {
            for n in near {
                coverage::cover(n, self.blur, &window, &self.steps, scratch);
                for (other, covered) in others.iter_mut().zip(scratch.iter()) {
                    *other += covered[0];
                }
            }
        }
        Some(Patch {
            window,
            level,
            weight,
            others,
        })
    }
}

/// Whether a dot widened by `reach` may touch a field; compares bounding boxes.
fn near(field: &Ellipse, dot: &Ellipse, reach: f64) -> bool {
    let gap = (dot.centre - field.centre).abs() - dot.reach() - field.reach();
    gap.max_element() < reach
}

fn weighted_median(mut values: Vec<(f64, f64)>) -> Option<f64> {
    values.retain(|v| v.0.is_finite() && v.1.is_finite());
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|v| v.1).sum::<f64>();
    let mut sum = 0.0;
    values
        .iter()
        .find(|v| {
            sum += v.1;
            sum >= half
        })
        .map(|v| v.0)
}
