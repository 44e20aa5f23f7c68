//! Fraction of each pixel that an ellipse covers, and its derivatives with respect to the ellipse's
//! parameters.
//!
//! By Green's theorem, a pixel's covered area is an integral along the outline e(t): the extent of
//! the pixel to the left of e, times dy. Its derivative with respect to a parameter q of the
//! outline is the integral of (de/dq x de/dt) over the part of the outline inside the pixel.
//!
//! Without blur, the outline is split where it crosses pixel borders, and each piece is integrated
//! by three-point Gauss quadrature: exact to about 1e-7 of a pixel. With Gaussian blur, the pixel's
//! box is convolved with the Gaussian, which gives a difference of normal distribution functions.
//! The integrand is then a smooth and periodic function of t, for which the trapezoid rule
//! converges exponentially: nodes h standard deviations apart err by about exp(-2 pi^2 / h^2). The
//! derivative with respect to the blur's variance is half the Laplacian (the heat equation).
//!
//! The distribution function comes from a table: nodes h = 1/32 apart, interpolated by cubic
//! Hermite polynomials, whose error is at most h^4 / 384 max|f''''|, below 1e-8 here.

use super::find::{Ellipse, Window};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Values of one pixel: 0: covered fraction; 1 to 5: its derivatives with respect to centre x, y,
/// shape xx, xy (both off-diagonal elements together), yy; 6: derivative with respect to the blur's
/// variance; 7: coverage that the outline inside this pixel adds to every pixel to its left in the
/// row.
pub(super) type Cell = [f64; 8];

/// Blur with a variance below this (in pixels squared) is treated as no blur.
pub(super) const SHARP: f64 = 0.01;

/// Spacing of nodes along the outline, in standard deviations of the blur.
const SPACING: f64 = 1.2;

/// Distance in standard deviations beyond which the blur is neglected.
const TAIL: f64 = 4.0;

/// Computes the coverage of each pixel of the window, row by row, into `cells`.
pub(super) fn cover(
    ellipse: &Ellipse,
    variance: f64,
    window: &Window,
    steps: &Steps,
    cells: &mut Vec<Cell>,
) {
    cells.clear();
    cells.resize(window.width * window.height, [0.0; 8]);
    if variance < SHARP {
        sharp(ellipse, window, cells);
    } else {
        blurred(ellipse, variance.sqrt(), window, steps, cells);
    }
    for row in cells.chunks_exact_mut(window.width) {
        let mut right = 0.0;
        for cell in row.iter_mut().rev() {
            cell[0] += right;
            right += cell[7];
        }
    }
}

/// One quadrature node of the outline: position relative to the window's first pixel, and
/// contribution to the derivatives with respect to centre x, y and shape xx, xy, yy.
struct Node {
    x: f64,
    y: f64,
    by: [f64; 5],
}

fn node(ellipse: &Ellipse, window: &Window, t: f64, dt: f64) -> Node {
    let (sin, cos) = t.sin_cos();
    let (a, b, d) = (
        ellipse.shape.x_axis.x,
        ellipse.shape.x_axis.y,
        ellipse.shape.y_axis.y,
    );
    let dx = (b * cos - a * sin) * dt;
    let dy = (d * cos - b * sin) * dt;
    Node {
        x: ellipse.centre.x - window.left as f64 + a * cos + b * sin,
        y: ellipse.centre.y - window.top as f64 + b * cos + d * sin,
        by: [dy, -dx, cos * dy, sin * dy - cos * dx, -sin * dx],
    }
}

fn sharp(ellipse: &Ellipse, window: &Window, cells: &mut [Cell]) {
    let mut cuts: Vec<f64> = (0..8).map(|k| f64::from(k) * FRAC_PI_4).collect();
    // x(t) = centre + reach cos(t - ahead), and y likewise.
    let (a, b, d) = (
        ellipse.shape.x_axis.x,
        ellipse.shape.x_axis.y,
        ellipse.shape.y_axis.y,
    );
    let reach = ellipse.reach();
    let mut cross = |centre: f64, reach: f64, ahead: f64| {
        let first = (centre - reach - 0.5).ceil();
        let count = (centre + reach - 0.5 - first).floor();
        for k in 0..=(count.max(-1.0) as i64) {
            let turn = ((first + k as f64 + 0.5 - centre) / reach)
                .clamp(-1.0, 1.0)
                .acos();
            cuts.push((ahead + turn).rem_euclid(TAU));
            cuts.push((ahead - turn).rem_euclid(TAU));
        }
    };
    cross(ellipse.centre.x, reach.x, b.atan2(a));
    cross(ellipse.centre.y, reach.y, d.atan2(b));
    cuts.sort_unstable_by(f64::total_cmp);
    cuts.push(TAU);
    /// Offset of the outer Gauss points from the middle, as a fraction of the interval:
    /// sqrt(3/5) / 2.
    const OUT: f64 = 0.387_298_334_620_741_7;
    for pair in cuts.windows(2) {
        let (from, length) = (pair[0], pair[1] - pair[0]);
        if !(length > 1e-12) {
            continue;
        }
        let middle = from + 0.5 * length;
        let centre = node(ellipse, window, middle, length * (8.0 / 18.0));
        let (column, row) = ((centre.x + 0.5).floor(), (centre.y + 0.5).floor());
        if !(row >= 0.0 && row < window.height as f64 && column >= 0.0) {
            continue;
        }
        let cells = &mut cells[row as usize * window.width..][..window.width];
        let sides = [-OUT, OUT].map(|side| {
            node(
                ellipse,
                window,
                middle + side * length,
                length * (5.0 / 18.0),
            )
        });
        let [one, two] = sides;
        for n in [one, centre, two] {
            let dy = n.by[0];
            if column >= window.width as f64 {
                let last = &mut cells[window.width - 1];
                last[0] += dy;
                last[7] += dy;
                continue;
            }
            let cell = &mut cells[column as usize];
            cell[0] += (n.x - (column - 0.5)) * dy;
            for (to, by) in cell[1..6].iter_mut().zip(n.by) {
                *to += by;
            }
            cell[7] += dy;
        }
    }
}

/// Maximum number of pixels that a node's blur reaches along an axis; the fit limits the blur
/// accordingly.
const SPAN: usize = 64;

/// For each pixel along one axis: the pixel's box convolved with the blur, evaluated at a node.
struct Profile {
    /// Pixels of the window that the node's blur reaches.
    range: std::ops::Range<usize>,
    /// Whether the blur around the node starts beyond the window's last pixel, so that the whole
    /// row lies to the node's left.
    beyond: bool,
    /// Per pixel of `range`: length of the pixel's part before the node, value of the blurred box
    /// at the node, and the derivative of that value.
    values: [[f64; 3]; SPAN],
}

impl Profile {
    fn fill(&mut self, at: f64, sigma: f64, pixels: usize, steps: &Steps) {
        let first = (at - 0.5 - TAIL * sigma).ceil();
        let last = (at + 0.5 + TAIL * sigma).floor();
        let end = (last + 1.0).clamp(0.0, pixels as f64) as usize;
        let begin = first.clamp(0.0, pixels as f64) as usize;
        self.beyond = first >= pixels as f64;
        self.range = begin..end.clamp(begin, begin + SPAN);
        let edge = |pixel: f64| {
            let u = (at - pixel) / sigma;
            let [f, d] = steps.at(u);
            // The mean of max(0, x - edge), x blurred, is sigma (u Phi + phi).
            [sigma * (u * f + d), f, d / sigma]
        };
        let mut before = edge(begin as f64 - 0.5);
        for (k, value) in self.range.clone().zip(&mut self.values) {
            let after = edge(k as f64 + 0.5);
            // Derivative with respect to the pixel's position: density at its far edge minus
            // density at its near edge.
            *value = [
                before[0] - after[0],
                before[1] - after[1],
                after[2] - before[2],
            ];
            before = after;
        }
    }
}

fn blurred(ellipse: &Ellipse, sigma: f64, window: &Window, steps: &Steps, cells: &mut [Cell]) {
    let [_, large] = ellipse.half_axes();
    let nodes = (TAU * large / (SPACING * sigma)).ceil().clamp(16.0, 4096.0);
    let empty = || Profile {
        range: 0..0,
        beyond: false,
        values: [[0.0; 3]; SPAN],
    };
    let (mut across, mut down) = (empty(), empty());
    for k in 0..nodes as usize {
        let n = node(ellipse, window, k as f64 * TAU / nodes, TAU / nodes);
        across.fill(n.x, sigma, window.width, steps);
        down.fill(n.y, sigma, window.height, steps);
        let [dy, mdx, ..] = n.by;
        for (v, &[_, ky, sy]) in down.range.clone().zip(&down.values) {
            let row = &mut cells[v * window.width..][..window.width];
            if across.beyond {
                let last = &mut row[window.width - 1];
                last[0] += ky * dy;
                last[7] += ky * dy;
                continue;
            }
            // Half the Laplacian: -1/2 times the integral of grad k . n along the outline.
            let [a, b, c, d, e] = n.by.map(|by| by * ky);
            let lanes = [0.0, a, b, c, d, e, -0.5 * sy * mdx, 0.0];
            let bend = -0.5 * ky * dy;
            for (cell, &[share, kx, sx]) in row[across.range.clone()].iter_mut().zip(&across.values)
            {
                for (to, lane) in cell.iter_mut().zip(lanes) {
                    *to += kx * lane;
                }
                cell[0] += share * a;
                cell[6] += sx * bend;
            }
            if let Some(cell) = row.get_mut(across.range.start) {
                cell[7] += a;
            }
        }
    }
}

/// Nodes per standard deviation.
const FINE: f64 = 32.0;
/// Range of the table in standard deviations. At both ends the function differs from 0 or 1 by
/// 1e-9.
const END: f64 = 6.0;

/// Table of the normal distribution function and of the density.
#[derive(Debug, Clone)]
pub(super) struct Steps {
    /// Function and density at each node.
    nodes: Vec<[f64; 2]>,
}

impl Steps {
    pub fn new() -> Self {
        let density = |u: f64| (-0.5 * u * u).exp() / std::f64::consts::TAU.sqrt();
        let h = 1.0 / FINE;
        // Phi(-6).
        let mut sum = 9.865_876_45e-10;
        let nodes = (0..=(2.0 * END * FINE) as usize)
            .map(|node| {
                let u = node as f64 * h - END;
                let here = [sum, density(u)];
                // Simpson's rule up to the next node, exact to 1e-12.
                sum += h / 6.0 * (here[1] + 4.0 * density(u + 0.5 * h) + density(u + h));
                here
            })
            .collect();
        Self { nodes }
    }

    /// Returns function and density at `u`.
    pub fn at(&self, u: f64) -> [f64; 2] {
        let place = (u + END) * FINE;
        if !(place > 0.0) {
            return [0.0, 0.0];
        }
        let node = place as usize;
        let Some([[f0, d0], [f1, d1]]) = self.nodes.get(node..node + 2).map(|n| [n[0], n[1]])
        else {
            return [1.0, 0.0];
        };
        let t = place - node as f64;
        let h = 1.0 / FINE;
        let u0 = node as f64 * h - END;
        let cubic = |y0: f64, s0: f64, y1: f64, s1: f64| {
            let rise = y1 - y0;
            y0 + t * (s0 + t * ((3.0 * rise - 2.0 * s0 - s1) + t * (s0 + s1 - 2.0 * rise)))
        };
        // The density's derivative is -u times the density.
        [
            cubic(f0, h * d0, f1, h * d1),
            cubic(d0, -h * u0 * d0, d1, -h * (u0 + h) * d1),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat2, DVec2};

    const WINDOW: Window = Window {
        left: 3,
        top: 5,
        width: 17,
        height: 15,
    };

    fn ellipse() -> Ellipse {
        Ellipse {
            centre: DVec2::new(10.83, 12.21),
            shape: DMat2::from_cols(DVec2::new(3.1, -0.7), DVec2::new(-0.7, 1.9)),
        }
    }

    fn covered(ellipse: &Ellipse, variance: f64) -> Vec<Cell> {
        let mut cells = Vec::new();
        cover(ellipse, variance, &WINDOW, &Steps::new(), &mut cells);
        cells
    }

    #[test]
    fn covered_pixels_add_up_to_the_ellipse() {
        let ellipse = ellipse();
        let area = std::f64::consts::PI * ellipse.size();
        for (variance, within) in [(0.0, 1e-5), (0.04, 1e-4), (0.3, 1e-3)] {
            let cells = covered(&ellipse, variance);
            let sum: f64 = cells.iter().map(|cell| cell[0]).sum();
            assert!((sum - area).abs() < within, "{variance}: {sum} {area}");
        }
    }

    #[test]
    fn each_pixel_is_covered_as_its_strips_are() {
        let ellipse = ellipse();
        let cells = covered(&ellipse, 0.0);
        for (px, cell) in WINDOW.pixels().zip(&cells) {
            // Reference: chords of thin strips, clipped to the pixel's sides.
            let strips = 20_000;
            let counted: f64 = (0..strips)
                .map(|k| {
                    let y = px.y - 0.5 + (f64::from(k) + 0.5) / f64::from(strips);
                    let [from, to] = chord(&ellipse, y);
                    (to.min(px.x + 0.5) - from.max(px.x - 0.5)).max(0.0)
                })
                .sum();
            assert!((cell[0] - counted / f64::from(strips)).abs() < 1e-5, "{px}");
        }
    }

    /// Returns the two x at which the horizontal line at `y` enters and leaves the ellipse.
    fn chord(ellipse: &Ellipse, y: f64) -> [f64; 2] {
        // |A^-1 (p - c)| = 1 is quadratic in x.
        let inverse = ellipse.shape.inverse();
        let (u, w) = (inverse.x_axis, inverse.y_axis * (y - ellipse.centre.y));
        let (a, b, c) = (u.length_squared(), u.dot(w), w.length_squared() - 1.0);
        let root = b * b - a * c;
        if root <= 0.0 {
            return [0.0, 0.0];
        }
        [-1.0, 1.0].map(|side| ellipse.centre.x + (-b + side * root.sqrt()) / a)
    }

    #[test]
    fn derivatives_are_differences() {
        for variance in [0.0, 0.05, 0.4, 2.0] {
            let cells = covered(&ellipse(), variance);
            let h = 1e-5;
            for parameter in 0..6 {
                // Without blur, the derivative with respect to the variance is not computed.
                if parameter == 5 && variance == 0.0 {
                    continue;
                }
                let moved = |h: f64| {
                    let mut e = ellipse();
                    let mut variance = variance;
                    match parameter {
                        0 => e.centre.x += h,
                        1 => e.centre.y += h,
                        2 => e.shape.x_axis.x += h,
                        3 => {
                            e.shape.x_axis.y += h;
                            e.shape.y_axis.x += h;
                        }
                        4 => e.shape.y_axis.y += h,
                        _ => variance += h,
                    }
                    covered(&e, variance)
                };
                for ((minus, plus), cell) in moved(-h).iter().zip(&moved(h)).zip(&cells) {
                    let slope = (plus[0] - minus[0]) / (2.0 * h);
                    let told = cell[1 + parameter];
                    assert!(
                        (slope - told).abs() < 2e-3,
                        "{variance} {parameter}: {slope} {told}"
                    );
                }
            }
        }
    }

    #[test]
    fn table_holds_the_published_values() {
        let steps = Steps::new();
        // Abramowitz and Stegun, table 26.1.
        for (u, f, d) in [
            (0.0, 0.5, 0.398_942_280_401),
            (1.0, 0.841_344_746_069, 0.241_970_724_519),
            (1.96, 0.975_002_104_852, 0.058_440_944_333),
            (3.0, 0.998_650_101_968, 0.004_431_848_412),
        ] {
            let [plus, density] = steps.at(u);
            let [minus, _] = steps.at(-u);
            assert!((plus - f).abs() < 1e-8 && (minus + f - 1.0).abs() < 1e-8);
            assert!((density - d).abs() < 1e-8, "{density} {d}");
        }
        assert_eq!(steps.at(-40.0), [0.0, 0.0]);
        assert_eq!(steps.at(40.0), [1.0, 0.0]);
        assert_eq!(steps.at(f64::NAN), [0.0, 0.0]);
    }
}
