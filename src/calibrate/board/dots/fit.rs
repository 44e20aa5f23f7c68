//! Fits an area model of a dot to the pixel levels around it.
//!
//! ```text
//! level(p) = paper(p) (1 - contrast coverage(p))
//! ```
//!
//! `paper` is a plane, so that uneven light affects ink and paper alike. `coverage` is the exact
//! fraction of the pixel that an ellipse covers, under the image's blur. The fit is Gauss-Newton
//! least squares, weighted by one over the pixel variance. Near convergence, pixels with residuals
//! above four standard deviations lose weight and those above eight have none (Hampel's three-part
//! function with a = b = 4, c = 8), so that dirt does not shift the dot. From then on, the noise is
//! estimated from the residuals, but is never taken to be below the predicted noise.

use super::coverage::{self, Cell, Steps};
use super::find::{Ellipse, Window};
use glam::{DMat2, DVec2};
use nalgebra::{SMatrix, SVector};
use phasmid_core::statistics::{MEDIAN_OF_NORMAL, median};

/// Number of unknowns: centre (2), shape (3), paper plane (3), contrast, blur.
const UNKNOWNS: usize = 10;
type Normal = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Vector = SVector<f64, UNKNOWNS>;

/// Maximum number of iterations. Successful fits need three to six.
const ROUNDS: usize = 16;
/// Hampel weights: residuals above `DOUBTED` standard deviations lose weight, above `REFUSED` have
/// none.
const DOUBTED: f64 = 4.0;
const REFUSED: f64 = 8.0;

/// The pixels that a dot is fitted to.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    pub window: Window,
    pub level: Vec<f64>,
    /// One over the variance; 0 excludes the pixel.
    pub weight: Vec<f64>,
    /// Fraction of each pixel that neighbouring dots cover.
    pub others: Vec<f64>,
}

/// Fitted parameters of a dot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Model {
    pub ellipse: Ellipse,
    /// Level of the paper at the patch's origin and its slopes per pixel.
    pub paper: [f64; 3],
    /// 1 minus the ratio of ink level to paper level; 1 means that the ink is black.
    pub contrast: f64,
    /// Variance of the blur in pixels squared.
    pub blur: f64,
}

/// Prior knowledge for a fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// Variance of the blur in pixels squared and the standard deviation of that variance. A
    /// standard deviation of 0 fixes the blur; `None` means no prior.
    pub blur: Option<[f64; 2]>,
    /// Ink contrast of the image and its standard deviation; `None` means no prior.
    pub contrast: Option<[f64; 2]>,
}

/// A fitted dot.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub model: Model,
    /// Covariance of the centre, in pixels squared.
    pub covariance: DMat2,
    /// Relative gradient of the light at the centre (gradient over level), per pixel.
    pub slope: DVec2,
    /// Sum of squared weighted residuals per degree of freedom.
    pub chi2: f64,
    /// Fraction of the information on the dot's centre that lies in pixels which the fit used.
    pub told: f64,
    /// Contrast divided by its standard deviation, which does not include the prior.
    pub strength: f64,
    /// Variance of the blur's variance; meaningful only if the blur was not fixed.
    pub blur_variance: f64,
}

impl Patch {
    /// Origin of the paper plane.
    pub fn origin(&self) -> DVec2 {
        let Window {
            left,
            top,
            width,
            height,
        } = self.window;
        DVec2::new(left as f64, top as f64) + 0.5 * DVec2::new(width as f64, height as f64)
    }
}

/// Normal equations at one set of parameters.
struct Normals {
    matrix: Normal,
    gradient: Vector,
    chi2: f64,
    count: f64,
    told: f64,
}

/// Fits a dot. Returns `None` if the patch shows no dot or the fit does not converge.
pub(super) fn fit(
    patch: &Patch,
    start: Ellipse,
    known: &Known,
    steps: &Steps,
    cells: &mut Vec<Cell>,
) -> Option<Fit> {
    let room = (patch.window.width.max(patch.window.height)) as f64;
    let mut model = Model {
        ellipse: start,
        paper: [0.0; 3],
        contrast: 0.0,
        blur: match known.blur {
            Some([blur, spread]) if spread > 0.0 => blur.max(2.0 * coverage::SHARP),
            Some([blur, _]) => blur,
            None => 0.1,
        },
    };
    coverage::cover(&model.ellipse, model.blur, &patch.window, steps, cells);
    (model.paper[0], model.contrast) = first_levels(patch, cells)?;
    let mut scale = None;
    let mut settled = 0;
    for _ in 0..ROUNDS {
        let mut normals = normals(patch, &model, known, cells, scale);
        let inverse = invert(&mut normals.matrix)?;
        let step = inverse * normals.gradient;
        let least = (step.rows(0, 5).norm()).max(step[8].abs());
        if !least.is_finite() {
            return None;
        }
        if settled == 2 {
            return finish(patch, model, &normals, &inverse, known);
        }
        // Limit long steps, so that the dot can neither jump away nor turn inside out in one step.
        let half = 0.5 * model.ellipse.half_axes()[0];
        let factor = (half.max(0.25) / step.rows(0, 5).amax())
            .min(0.3 / step[8].abs())
            .min(1.0);
        apply(&mut model, &(step * factor));
        let [_, large] = model.ellipse.half_axes();
        let away = (model.ellipse.centre - start.centre).length();
        if !(model.ellipse.is_sound() && large < room && away < room) {
            return None;
        }
        coverage::cover(&model.ellipse, model.blur, &patch.window, steps, cells);
        if least < 0.1 {
            scale = Some(spread(patch, &model, cells));
        }
        // Steps shrink about quadratically: after a step as short as this, the remaining error is
        // negligible.
        settled = if least < 2e-3 && factor == 1.0 { 2 } else { 0 };
    }
    None
}

/// Estimates the paper's level and the contrast by linear regression of level on coverage.
fn first_levels(patch: &Patch, cells: &[Cell]) -> Option<(f64, f64)> {
    let (mut n, mut c, mut cc, mut l, mut cl) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ((&level, &weight), (cell, &others)) in patch
        .level
        .iter()
        .zip(&patch.weight)
        .zip(cells.iter().zip(&patch.others))
    {
        if weight > 0.0 {
            let share = cell[0] + others;
            n += 1.0;
            c += share;
            cc += share * share;
            l += level;
            cl += share * level;
        }
    }
    let slope = (n * cl - c * l) / (n * cc - c * c);
    let paper = (l - slope * c) / n;
    let contrast = -slope / paper;
    (paper > 0.0 && contrast > 0.0 && contrast.is_finite())
        .then(|| (paper, contrast.clamp(0.2, 1.0)))
}

fn apply(model: &mut Model, step: &Vector) {
    model.ellipse.centre += DVec2::new(step[0], step[1]);
    model.ellipse.shape +=
        DMat2::from_cols(DVec2::new(step[2], step[3]), DVec2::new(step[3], step[4]));
    for k in 0..3 {
        model.paper[k] += step[5 + k];
    }
    model.contrast = (model.contrast + step[8]).clamp(0.05, 1.5);
    model.blur = (model.blur + step[9]).clamp(coverage::SHARP.min(model.blur), 25.0);
}

/// Robust standard deviation of the weighted residuals, from their median; at least 1.
fn spread(patch: &Patch, model: &Model, cells: &[Cell]) -> f64 {
    let mut sizes: Vec<f64> = residuals(patch, model, cells)
        .filter(|r| r.weight > 0.0)
        .map(|r| r.residual * r.residual * r.weight)
        .collect();
    median(&mut sizes).map_or(1.0, |median| (median.sqrt() / MEDIAN_OF_NORMAL).max(1.0))
}

/// A pixel's residual and the model terms at that pixel.
struct Residual {
    residual: f64,
    weight: f64,
    paper: f64,
    share: f64,
    offset: DVec2,
}

fn residuals<'a>(
    patch: &'a Patch,
    model: &'a Model,
    cells: &'a [Cell],
) -> impl Iterator<Item = Residual> + 'a {
    let origin = patch.origin();
    patch
        .window
        .pixels()
        .zip(patch.level.iter().zip(&patch.weight))
        .zip(cells.iter().zip(&patch.others))
        .map(move |((px, (&level, &weight)), (cell, &others))| {
            let offset = px - origin;
            let [p0, px, py] = model.paper;
            let paper = p0 + px * offset.x + py * offset.y;
            let share = cell[0] + others;
            Residual {
                residual: level - paper * (1.0 - model.contrast * share),
                weight,
                paper,
                share,
                offset,
            }
        })
}

fn normals(
    patch: &Patch,
    model: &Model,
    known: &Known,
    cells: &[Cell],
    scale: Option<f64>,
) -> Normals {
    // Upper triangle of the normal matrix, by rows.
    let mut sums = [[0.0; UNKNOWNS]; UNKNOWNS];
    let mut gradient = [0.0; UNKNOWNS];
    let (mut chi2, mut count) = (0.0, 0.0);
    let (mut told, mut all) = (0.0, 0.0);
    let fixed = matches!(known.blur, Some([_, spread]) if spread <= 0.0);
    let unknowns = if fixed { 9 } else { 10 };
    for (at, cell) in residuals(patch, model, cells).zip(cells) {
        let edge = cell[1] * cell[1] + cell[2] * cell[2];
        all += edge;
        if !(at.weight > 0.0) {
            continue;
        }
        let trust = scale.map_or(1.0, |scale| {
            let z = at.residual.abs() * at.weight.sqrt() / scale;
            if z <= DOUBTED {
                1.0
            } else {
                ((REFUSED - z) / (REFUSED - DOUBTED)).max(0.0) * DOUBTED / z
            }
        });
        if !(trust > 0.0) {
            continue;
        }
        told += edge * trust;
        let weight = at.weight * trust;
        chi2 += weight * at.residual * at.residual;
        count += trust;
        let ink = -at.paper * model.contrast;
        let lit = 1.0 - model.contrast * at.share;
        let row: [f64; UNKNOWNS] = [
            ink * cell[1],
            ink * cell[2],
            ink * cell[3],
            ink * cell[4],
            ink * cell[5],
            lit,
            lit * at.offset.x,
            lit * at.offset.y,
            -at.paper * at.share,
            ink * cell[6],
        ];
        for i in 0..unknowns {
            let scaled = weight * row[i];
            gradient[i] += scaled * at.residual;
            for j in i..UNKNOWNS {
                sums[i][j] += scaled * row[j];
            }
        }
    }
    if let Some([mean, sigma]) = known.contrast {
        sums[8][8] += 1.0 / (sigma * sigma);
        gradient[8] += (mean - model.contrast) / (sigma * sigma);
    }
    if let (false, Some([mean, sigma])) = (fixed, known.blur) {
        sums[9][9] += 1.0 / (sigma * sigma);
        gradient[9] += (mean - model.blur) / (sigma * sigma);
    }
    if fixed {
        for row in &mut sums {
            row[9] = 0.0;
        }
        sums[9][9] = 1.0;
    }
    Normals {
        matrix: Normal::from_fn(|i, j| sums[i.min(j)][i.max(j)]),
        gradient: Vector::from(gradient),
        chi2: chi2 / (count - unknowns as f64).max(1.0),
        count: count - unknowns as f64,
        told: told / all,
    }
}

/// Inverts the normal matrix by Cholesky decomposition, after scaling its diagonal to 1.
fn invert(matrix: &mut Normal) -> Option<Normal> {
    let scale: Vector = matrix.diagonal().map(|d| 1.0 / d.sqrt());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let balanced = Normal::from_fn(|i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let inverse = balanced.cholesky()?.inverse();
    Some(Normal::from_fn(|i, j| {
        inverse[(i, j)] * scale[i] * scale[j]
    }))
}

fn finish(
    patch: &Patch,
    model: Model,
    normals: &Normals,
    inverse: &Normal,
    known: &Known,
) -> Option<Fit> {
    let covariance = DMat2::from_cols(
        DVec2::new(inverse[(0, 0)], inverse[(0, 1)]),
        DVec2::new(inverse[(0, 1)], inverse[(1, 1)]),
    );
    let [level, right, down] = model.paper;
    let away = model.ellipse.centre - patch.origin();
    let slope = DVec2::new(right, down);
    let slope = slope / (level + slope.dot(away));
    let strength = match known.contrast {
        // Remove the prior's information: only the dot's own pixels count.
        Some([_, sigma]) => {
            let own = (1.0 / inverse[(8, 8)] - 1.0 / (sigma * sigma)).max(0.0);
            model.contrast * own.sqrt()
        }
        None => model.contrast / inverse[(8, 8)].sqrt(),
    };
    (normals.count > 0.0 && covariance.determinant() > 0.0 && normals.chi2.is_finite()).then_some(
        Fit {
            model,
            covariance,
            slope,
            chi2: normals.chi2,
            told: normals.told,
            strength,
            blur_variance: inverse[(9, 9)],
        },
    )
}
