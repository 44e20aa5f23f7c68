//! Measures a corner by fitting an area model to the pixel levels around it.
//!
//! Two straight edges cross at c. A pixel at distances u1, u2 from them has the level
//!
//! ```text
//! I = (1 + g . d) (m + k S),   S = E1 E2 + 4 integral from 0 to rho of phi2(u1 / s, u2 / s; r) dr
//! ```
//!
//! where d is the pixel's position in the window, E = 2 F - 1 with F an [`Edge`]'s share, rho the
//! cosine between the edges' normals, s the standard deviation of the blur and the pixel's box
//! together, and phi2 the density of the bivariate normal distribution. S is the mean of sign(u1)
//! sign(u2) under the blur. E1 E2 alone is exact for edges at right angles; the integral is the
//! contribution of correlation (Plackett, "A reduction formula for normal multivariate integrals",
//! Biometrika 41, 1954). It matters only for the few pixels next to the corner. If the blur is
//! narrower than a pixel, these pixels are divided into subpixels small enough for a Gaussian to
//! approximate each; the difference to E1 E2 of the whole pixel then also includes the covariance
//! of the signs within the pixel. The light gradient (1 + g . d) acts before the blur, which shifts
//! S by -g s^2, to first order.
//!
//! The nine unknowns (c, two angles, the blur's variance, m, k, g) are fitted by
//! Levenberg-Marquardt least squares, weighted by one over each pixel's variance. A sharp edge
//! along the pixel rows contains no information on the blur, so the fit uses a prior for it; see
//! [`super::blur`].

use super::blur::Blur;
use super::edge::{Edge, normal};
use crate::board::BoardImage;
use glam::{DMat2, DVec2};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::PI;

const UNKNOWNS: usize = 9;
/// Index of the blur's variance among the unknowns.
const BLUR: usize = 4;
type Square = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Column = SVector<f64, UNKNOWNS>;

/// Variance of a pixel's box (a uniform square of side 1) along any direction, in pixels squared.
const PIXEL: f64 = 1.0 / 12.0;
/// Maximum half side of a window in pixels, unless the blur needs more.
const REACH: f64 = 8.0;
/// Distance from both edges, in standard deviations, within which a pixel is next to the corner.
const NEAR: f64 = 4.0;
/// Gauss-Legendre nodes on [0, 1] and their weights.
const NODES: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_9),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_1),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_1),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_9),
];

/// Predicted position of a corner and the steps to the next corners along the board's x and y, in
/// pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Guess {
    pub(super) px: DVec2,
    pub(super) along_x: DVec2,
    pub(super) along_y: DVec2,
    /// Whether the square between the board's -x and -y is dark.
    pub(super) dark: bool,
}

/// A measured corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub(super) px: DVec2,
    /// Covariance in pixels squared: follows from the image noise, scaled up if the fit's residuals
    /// exceed that noise.
    pub(super) covariance: DMat2,
    /// Variance of the blur in pixels squared, and the standard deviation of that variance.
    pub(super) blur: [f64; 2],
}

/// Measures a corner. `blur` is the prior for its blur. Returns `None` if the image has no corner
/// of the expected polarity at the predicted position, or if the fit is poor.
pub(super) fn fit(image: &BoardImage, guess: &Guess, blur: &Blur) -> Option<Corner> {
    let turn = guess.along_x.perp_dot(guess.along_y);
    if !(turn.is_finite() && guess.px.is_finite() && turn > 1.0) {
        return None;
    }
    // Fit first in a window for a typical blur, then in a window for the estimated blur.
    let mut state = State::first(guess, blur);
    let window = Window::cut(image, guess, guess.px, blur, 0.7)?;
    state.level(&window)?;
    window.solve(&mut state, guess, 0.01)?;
    let (centre, wide) = (state.centre, (state.variance + PIXEL).sqrt());
    let window = Window::cut(image, guess, centre, blur, wide)?;
    let fit = window.solve(&mut state, guess, 1e-4)?;
    state.accept(&window, &fit, guess)
}

/// Values of the unknowns.
#[derive(Debug, Clone, Copy)]
struct State {
    centre: DVec2,
    angles: [f64; 2],
    variance: f64,
    mean: f64,
    contrast: f64,
    gradient: DVec2,
}

/// One pixel of a window.
struct Pixel {
    place: DVec2,
    level: f64,
    weight: f64,
}

struct Window {
    origin: DVec2,
    blur: Blur,
    pixels: Vec<Pixel>,
}

/// Normal equations and cost at one set of unknowns.
struct Fit {
    squares: f64,
    /// `squares` plus the cost of the blur's prior. `normal` and `right` also include that prior.
    cost: f64,
    normal: Square,
    right: Column,
}

impl State {
    fn first(guess: &Guess, blur: &Blur) -> Self {
        let x = guess.along_x;
        let first = x.y.atan2(x.x);
        Self {
            centre: guess.px,
            angles: [first, first + x.angle_to(guess.along_y)],
            variance: blur.variance,
            mean: 0.0,
            contrast: 0.0,
            gradient: DVec2::ZERO,
        }
    }

    /// Estimates mean and contrast by linear least squares, with all other unknowns fixed.
    fn level(&mut self, window: &Window) -> Option<()> {
        (self.mean, self.contrast) = (0.0, 1.0);
        let (mut sums, mut right) = ([0.0; 3], [0.0; 2]);
        let model = self.model();
        for p in &window.pixels {
            let s = model.at(p.place - self.centre).0;
            sums[0] += p.weight;
            sums[1] += p.weight * s;
            sums[2] += p.weight * s * s;
            right[0] += p.weight * p.level;
            right[1] += p.weight * p.level * s;
        }
        let determinant = sums[0] * sums[2] - sums[1] * sums[1];
        self.mean = (sums[2] * right[0] - sums[1] * right[1]) / determinant;
        self.contrast = (sums[0] * right[1] - sums[1] * right[0]) / determinant;
        (self.mean.is_finite() && self.contrast.is_finite()).then_some(())
    }

    fn model(&self) -> Model {
        let [(s1, c1), (s2, c2)] = self.angles.map(f64::sin_cos);
        let normals = [DVec2::new(-s1, c1), DVec2::new(s2, -c2)];
        Model {
            normals,
            along: [DVec2::new(c1, s1), DVec2::new(c2, s2)],
            edges: normals.map(|n| Edge::new(n.x, n.y, self.variance)),
            pieces: pieces(self.variance),
            variance: self.variance.max(0.0),
            lean: normals[0].dot(normals[1]).clamp(-1.0, 1.0).asin(),
        }
    }

    /// Computes the level at a pixel and its derivatives with respect to the unknowns.
    fn at(&self, model: &Model, origin: DVec2, place: DVec2) -> (f64, Column) {
        let d = place - origin;
        let spread = self.variance + PIXEL;
        let from_centre = place - self.centre + self.gradient * spread;
        let (s, by_distance, by_variance) = model.at(from_centre);
        let shade = 1.0 + self.gradient.dot(d);
        let plain = self.mean + self.contrast * s;
        let scale = shade * self.contrast;
        let by_place = model.normals[0] * by_distance[0] + model.normals[1] * by_distance[1];
        let by_gradient = plain * d + scale * spread * by_place;
        let row = [
            -scale * by_place.x,
            -scale * by_place.y,
            -scale * by_distance[0] * model.along[0].dot(from_centre),
            scale * by_distance[1] * model.along[1].dot(from_centre),
            scale * (by_variance + self.gradient.dot(by_place)),
            shade,
            shade * s,
            by_gradient.x,
            by_gradient.y,
        ];
        (shade * plain, row.into())
    }

    fn moved(&self, step: &Column) -> Self {
        Self {
            centre: self.centre + DVec2::new(step[0], step[1]),
            angles: [self.angles[0] + step[2], self.angles[1] + step[3]],
            variance: (self.variance + step[4]).max(0.0),
            mean: self.mean + step[5],
            contrast: self.contrast + step[6],
            gradient: self.gradient + DVec2::new(step[7], step[8]),
        }
    }

    /// Whether the unknowns are plausible for the predicted corner.
    fn is_near(&self, guess: &Guess) -> bool {
        let shortest = guess.along_x.length().min(guess.along_y.length());
        let open = self.angles[1] - self.angles[0];
        self.centre.distance(guess.px) <= (0.3 * shortest).min(4.0)
            && (0.15..PI - 0.15).contains(&open)
            && self.variance <= shortest * shortest / 9.0
    }

    /// Standard deviation of the blur's variance. Evaluated at a variance of at least `Blur::SEEN`,
    /// because below it the derivative with respect to the variance is zero almost everywhere.
    fn blur_sigma(&self, window: &Window) -> f64 {
        let variance = self.variance.max(Blur::SEEN);
        let fit = window.fit(&Self { variance, ..*self });
        let inverse = fit.normal.cholesky().map(|c| c.inverse());
        inverse.map_or(f64::INFINITY, |inverse| inverse[(BLUR, BLUR)].sqrt())
    }

    fn accept(&self, window: &Window, fit: &Fit, guess: &Guess) -> Option<Corner> {
        let inverse = fit.normal.cholesky()?.inverse();
        let freedom = window.pixels.len() as f64 - UNKNOWNS as f64;
        let excess = (fit.squares / freedom).max(1.0);
        let covariance = DMat2::from_cols_array(&[
            inverse[(0, 0)],
            inverse[(1, 0)],
            inverse[(0, 1)],
            inverse[(1, 1)],
        ]) * excess;
        // Reject the wrong polarity, contrast within the noise, and poor fits.
        let error = (inverse[(6, 6)] * excess).sqrt();
        let weights: f64 = window.pixels.iter().map(|p| p.weight).sum();
        let misfit = (fit.squares / weights).sqrt();
        let noise = (window.pixels.len() as f64 / weights).sqrt();
        let strong =
            self.contrast.abs() > 5.0 * error && misfit <= 3.0 * noise + 0.3 * self.contrast.abs();
        let sharp = covariance.x_axis.x + covariance.y_axis.y < 0.25;
        ((self.contrast < 0.0) == guess.dark && strong && sharp && covariance.is_finite()).then(
            || Corner {
                px: self.centre,
                covariance,
                blur: [self.variance, self.blur_sigma(window) * excess.sqrt()],
            },
        )
    }
}

struct Model {
    normals: [DVec2; 2],
    along: [DVec2; 2],
    edges: [Edge; 2],
    /// Number of subpixels along a pixel's side.
    pieces: u32,
    variance: f64,
    /// Arc sine of the correlation of the two distances.
    lean: f64,
}

impl Model {
    /// Computes S, and the derivatives of S with respect to both distances and the blur's variance.
    fn at(&self, d: DVec2) -> (f64, [f64; 2], f64) {
        let u = self.normals.map(|n| n.dot(d));
        let [p, q] = [self.edges[0].at(u[0]), self.edges[1].at(u[1])];
        let (e1, e2) = (2.0 * p.share - 1.0, 2.0 * q.share - 1.0);
        let mut s = e1 * e2;
        let mut by = [2.0 * p.by_distance * e2, 2.0 * q.by_distance * e1];
        let mut by_variance = 2.0 * (p.by_variance * e2 + q.by_variance * e1);
        let sigma = (self.variance + PIXEL).sqrt();
        if u.iter().all(|u| u.abs() < NEAR * sigma) {
            let common = self.common(d);
            s += common.s;
            by[0] += common.by[0];
            by[1] += common.by[1];
            by_variance += common.by_variance;
        }
        (s, by, by_variance)
    }

    /// Computes the covariance of the signs of both distances within a pixel, and the derivatives
    /// of that covariance.
    fn common(&self, d: DVec2) -> Signs {
        let n = f64::from(self.pieces);
        let place = |i: u32| (f64::from(i) + 0.5) / n - 0.5;
        let sigma = (self.variance + PIXEL / (n * n)).sqrt();
        let (mut sum, mut means) = (Signs::default(), [[0.0; 3]; 2]);
        for (i, j) in (0..self.pieces).flat_map(|i| (0..self.pieces).map(move |j| (i, j))) {
            let d = d + DVec2::new(place(i), place(j));
            let u = self.normals.map(|n| n.dot(d) / sigma);
            // Mean of each edge's sign, and the derivatives of that mean with respect to the
            // distance and the variance.
            let signs = u.map(|u| {
                let (share, density) = normal(u);
                let slope = 2.0 * density / sigma;
                [2.0 * share - 1.0, slope, -0.5 * u * slope / sigma]
            });
            let [p, q] = signs;
            let more = self.correlated(u, sigma);
            sum.s += p[0] * q[0] + more.s;
            sum.by[0] += p[1] * q[0] + more.by[0];
            sum.by[1] += p[0] * q[1] + more.by[1];
            sum.by_variance += p[2] * q[0] + p[0] * q[2] + more.by_variance;
            for (mean, sign) in means.iter_mut().zip(signs) {
                (0..3).for_each(|k| mean[k] += sign[k] / (n * n));
            }
        }
        let ([p, q], share) = (means, 1.0 / (n * n));
        Signs {
            s: sum.s * share - p[0] * q[0],
            by: [
                sum.by[0] * share - p[1] * q[0],
                sum.by[1] * share - p[0] * q[1],
            ],
            by_variance: sum.by_variance * share - p[2] * q[0] - p[0] * q[2],
        }
    }

    /// Contribution of the correlation, at distances in standard deviations.
    fn correlated(&self, [h, k]: [f64; 2], sigma: f64) -> Signs {
        let mut signs = Signs::default();
        if h * h + k * k < 36.0 && self.lean.abs() > 1e-3 {
            // Substituting r = sin(x) turns dr / sqrt(1 - r^2) into dx.
            for (node, weight) in NODES {
                let (r, c) = (self.lean * node).sin_cos();
                let squares = (h * h - 2.0 * r * h * k + k * k) / (c * c);
                let part = 4.0 * weight * self.lean * (-0.5 * squares).exp() / (2.0 * PI);
                signs.s += part;
                let slope = part / (c * c * sigma);
                signs.by[0] -= slope * (h - r * k);
                signs.by[1] -= slope * (k - r * h);
                signs.by_variance += 0.5 * part * squares / (sigma * sigma);
            }
        }
        signs
    }
}

/// Mean of the product of two signs, and the derivatives of that mean with respect to both
/// distances and the blur's variance.
#[derive(Default)]
struct Signs {
    s: f64,
    by: [f64; 2],
    by_variance: f64,
}

/// Returns the number of subpixels along a pixel's side that is needed for a Gaussian to
/// approximate each blurred subpixel.
fn pieces(variance: f64) -> u32 {
    match variance {
        v if v < 0.06 => 4,
        v if v < 0.25 => 2,
        _ => 1,
    }
}

impl Window {
    /// Collects the pixels that depend only on the corner's own two edges, for a corner at `centre`
    /// and a blur (standard deviation) of `blur` pixels.
    fn cut(
        image: &BoardImage,
        guess: &Guess,
        centre: DVec2,
        known: &Blur,
        blur: f64,
    ) -> Option<Self> {
        let turn = guess.along_x.perp_dot(guess.along_y);
        let along = [guess.along_x, guess.along_y];
        // Maximum distance of a pixel from each edge, so that the window contains no other edges of
        // the board.
        let reach = along.map(|a| {
            let next = turn / a.length();
            (next - 0.75 - 2.0 * blur).min(0.75 * next).max(0.45 * next)
        });
        let normals = along.map(|a| a.perp().normalize());
        let radius = REACH.max(4.0 * blur);
        let bounds = |middle: f64, size: usize| {
            let low = (middle - radius).ceil().max(0.0);
            let high = (middle + radius).floor().min(size as f64 - 1.0);
            (low <= high).then_some((low as usize, high as usize))
        };
        let (left, right) = bounds(centre.x, image.width)?;
        let (top, bottom) = bounds(centre.y, image.height)?;
        let mut pixels = Vec::new();
        for (y, x) in (top..=bottom).flat_map(|y| (left..=right).map(move |x| (y, x))) {
            let place = DVec2::new(x as f64, y as f64);
            let d = place - centre;
            let inside = (0..2).all(|i| normals[i].dot(d).abs() <= reach[i]);
            let at = y * image.width + x;
            let (level, variance) = (f64::from(image.level[at]), f64::from(image.variance[at]));
            let known = level.is_finite() && variance > 0.0 && variance.is_finite();
            if inside && known && d.length() <= radius {
                let weight = 1.0 / variance;
                pixels.push(Pixel {
                    place,
                    level,
                    weight,
                });
            }
        }
        (pixels.len() >= 2 * UNKNOWNS).then_some(Self {
            origin: centre,
            blur: *known,
            pixels,
        })
    }

    fn fit(&self, state: &State) -> Fit {
        let model = state.model();
        let (mut squares, mut normal, mut right) = (0.0, Square::zeros(), Column::zeros());
        for p in &self.pixels {
            let (level, row) = state.at(&model, self.origin, p.place);
            let off = p.level - level;
            squares += p.weight * off * off;
            let weighted = row * p.weight;
            right += weighted * off;
            normal.ger(1.0, &weighted, &row, 1.0);
        }
        let off = self.blur.variance - state.variance;
        let mut cost = squares;
        if self.blur.spread > 0.0 {
            let weight = self.blur.spread.powi(-2);
            cost += weight * off * off;
            normal[(BLUR, BLUR)] += weight;
            right[BLUR] += weight * off;
        } else {
            normal.fill_row(BLUR, 0.0);
            normal.fill_column(BLUR, 0.0);
            normal[(BLUR, BLUR)] = 1.0;
            right[BLUR] = 0.0;
        }
        Fit {
            squares,
            cost,
            normal,
            right,
        }
    }

    /// Minimises the cost. Stops once a step moves the centre by less than `enough` pixels and the
    /// cost hardly falls.
    fn solve(&self, state: &mut State, guess: &Guess, enough: f64) -> Option<Fit> {
        let mut fit = self.fit(state);
        let mut damping = 1e-4;
        for _ in 0..30 {
            let mut damped = fit.normal;
            for i in 0..UNKNOWNS {
                damped[(i, i)] += damping * fit.normal[(i, i)] + 1e-12;
            }
            let next = state.moved(&damped.cholesky()?.solve(&fit.right));
            let after = self.fit(&next);
            if after.cost <= fit.cost && next.is_near(guess) {
                let gain = fit.cost - after.cost;
                let settled = next.centre.distance(state.centre) < enough
                    && gain < 1.0 + 0.01 * after.squares;
                (*state, fit) = (next, after);
                damping = (damping * 0.1).max(1e-9);
                if settled {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        (fit.squares.is_finite() && state.is_near(guess)).then_some(fit)
    }
}
