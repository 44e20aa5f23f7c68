//! Finds where a lens's distortion folds over, and inverts the distortion on the correct side of
//! the fold.
//!
//! The Brown-Conrady distortion F of [`Lens::distort`] is the gradient of
//!
//! ```text
//! phi = r^2/2 + k1 r^4/4 + k2 r^6/6 + k3 r^8/8 + r^2 (p2 x + p1 y)
//! ```
//!
//! so its Jacobian is symmetric, and F is one-to-one on any disc around the axis on which the
//! Jacobian is positive definite: phi is strictly convex there, and undistorting is a convex
//! minimisation (Boyd and Vandenberghe, "Convex Optimization", 3.1.4 and 9.5). In polar
//! coordinates, with theta measured from the direction (p2, p1) and t = r |(p1, p2)|, the Jacobian
//! is
//!
//! ```text
//! | a + 6 t cos(theta)    -2 t sin(theta)    |    a = 1 + 3 k1 r^2 + 5 k2 r^4 + 7 k3 r^6
//! | -2 t sin(theta)     b + 2 t cos(theta)   |    b = 1 +   k1 r^2 +   k2 r^4 +   k3 r^6
//! ```
//!
//! Its determinant, a quadratic in cos(theta), is smallest at theta = pi as long as a + 3 b >= 16
//! t, where it is (a - 6 t)(b - 2 t). If a > 6 t from the axis out to r, then b > 3 t. So the disc
//! extends to the first zero of a - 6 t or of a + 3 b - 16 t: exactly to the fold without
//! tangential terms, and to the fold in the worst direction with them.

use super::Lens;
#[cfg(test)]
use glam::DMat2;
use glam::DVec2;

/// Coefficients of r^0 to r^6.
type Polynomial = [f64; 7];

/// Ideal radius limit of the search: 0.0002 arc seconds from 90 degrees off axis.
const FAR: f64 = 1e9;

impl Lens {
    /// Message text: allowed values for a file whose coefficients fold.
    pub const FOLD_ALLOWED: &str = "coefficients that can be inverted over the whole image";

    /// Message text: what was found in a file whose coefficients fold; `corner` comes from
    /// [`Self::folds_before`].
    #[doc(hidden)]
    pub fn fold_found(corner: DVec2) -> String {
        format!(
            "an image that folds over between the principal point and pixel ({:.0}, {:.0})",
            corner.x, corner.y
        )
    }

    /// Returns the tangent of the angle to the axis within which the distortion folds in no
    /// direction; 1e9 or more means no limit.
    #[inline]
    pub fn unfolded_radius(&self) -> f64 {
        self.conditions()
            .iter()
            .map(|c| first_zero(c, 0.0, FAR).unwrap_or(FAR))
            .fold(FAR, f64::min)
    }

    /// Returns an image corner that has no ray because the distortion folds between the principal
    /// point and the corner; `None` if every pixel has one ray.
    #[doc(hidden)]
    pub fn folds_before(&self) -> Option<DVec2> {
        if !self.is_distorted() {
            return None;
        }
        let (w, h) = (f64::from(self.width_px), f64::from(self.height_px));
        let corners = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|c| DVec2::from(c) - 0.5);
        let radius = |px: DVec2| ((px - self.principal_px) / self.focal_px).length();
        let far = corners
            .into_iter()
            .max_by(|a, b| radius(*a).total_cmp(&radius(*b)))?;
        // Every point of the circle |p| = r is mapped at least this far outwards. If this exceeds
        // the radius of a target, the minimum of the convex function, which is the target's ideal
        // point, lies inside the circle.
        let [k1, k2, .., k3] = self.distortion;
        let r = self.unfolded_radius();
        let s = r * r;
        let least = r * (1.0 + s * (k1 + s * (k2 + s * k3))) - 3.0 * self.tangential() * s;
        let inverts = least > radius(far);
        (!inverts).then_some(far)
    }

    /// Returns whether an ideal point lies in the disc without folds.
    pub(super) fn is_unfolded(&self, ideal: DVec2) -> bool {
        let r = ideal.length();
        self.conditions()
            .iter()
            .all(|c| lower_bound(c, 0.0, r) > 0.0 || first_zero(c, 0.0, r).is_none())
    }

    /// Returns the ideal point of a distorted point by damped Newton steps on the convex function phi(p)
    /// - d p, starting from the axis: the inverse within the disc, or NaN if there is none.
    pub(super) fn descend(&self, d: DVec2) -> DVec2 {
        let reach = self.unfolded_radius();
        let height = |p: DVec2| self.potential(p) - d.dot(p);
        let mut p = DVec2::ZERO;
        for _ in 0..200 {
            let slope = self.distort(p) - d;
            let step = -(self.distort_jacobian(p).inverse() * slope);
            if step.length() <= 1e-15 * (1.0 + p.length()) {
                break;
            }
            // Armijo's rule: halve the step until it descends sufficiently and stays in the disc.
            let mut part = 1.0;
            let down = |part: f64| {
                let next = p + step * part;
                next.length() < reach && height(next) <= height(p) + 1e-4 * part * slope.dot(step)
            };
            // Near the minimum, heights differ only by rounding, and full steps converge.
            let close = step.length() <= 1e-6 * (1.0 + p.length());
            while !close && part > 1e-9 && !down(part) {
                part *= 0.5;
            }
            p += step * part;
        }
        let residual = (self.distort(p) - d).length();
        if residual <= 1e-13 * (1.0 + d.length()) && p.length() < reach {
            p
        } else {
            DVec2::NAN
        }
    }

    /// Returns phi, the potential whose gradient is the distortion.
    fn potential(&self, p: DVec2) -> f64 {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let s = p.length_squared();
        let radial = 0.5 + s * (k1 / 4.0 + s * (k2 / 6.0 + s * k3 / 8.0));
        s * (radial + p2 * p.x + p1 * p.y)
    }

    fn tangential(&self) -> f64 {
        self.distortion[2].hypot(self.distortion[3])
    }

    /// Polynomials in r that are both positive from 0 up to the first fold.
    fn conditions(&self) -> [Polynomial; 2] {
        let [k1, k2, .., k3] = self.distortion;
        let p = self.tangential();
        [
            [1.0, -6.0 * p, 3.0 * k1, 0.0, 5.0 * k2, 0.0, 7.0 * k3],
            [4.0, -16.0 * p, 6.0 * k1, 0.0, 8.0 * k2, 0.0, 10.0 * k3],
        ]
    }
}

/// Returns a lower bound of the polynomial on an interval of positive numbers.
fn lower_bound(c: &Polynomial, low: f64, high: f64) -> f64 {
    let (mut bound, mut least, mut most) = (0.0, 1.0, 1.0);
    for &c in c {
        bound += if c > 0.0 {
            c * least
        } else if c < 0.0 {
            c * most
        } else {
            0.0
        };
        least *= low;
        most *= high;
    }
    bound
}

/// Returns the first point of an interval of positive numbers where the polynomial is not positive,
/// to nine digits, erring on the low side.
fn first_zero(c: &Polynomial, low: f64, high: f64) -> Option<f64> {
    if lower_bound(c, low, high) > 0.0 {
        return None;
    }
    if high - low <= 1e-9 * high {
        return Some(low);
    }
    let middle = 0.5 * (low + high);
    first_zero(c, low, middle).or_else(|| first_zero(c, middle, high))
}

/// Returns the smallest eigenvalue of a symmetric matrix.
#[cfg(test)]
fn least_eigenvalue(m: DMat2) -> f64 {
    let (mean, half) = (
        0.5 * (m.x_axis.x + m.y_axis.y),
        0.5 * (m.x_axis.x - m.y_axis.y),
    );
    mean - half.hypot(m.x_axis.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(distortion: [f64; 5]) -> Lens {
        Lens {
            width_px: 1138,
            height_px: 489,
            focal_px: DVec2::splat(632.0),
            principal_px: DVec2::new(568.5, 244.0),
            distortion,
        }
    }

    /// Uniform numbers in [-1, 1).
    fn draws(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0
        }
    }

    #[test]
    fn the_disc_ends_where_the_worst_direction_folds() {
        let mut draw = draws(3);
        let mut folded = 0;
        for _ in 0..300 {
            let lens = lens([
                draw() * 0.5,
                draw() * 0.3,
                draw() * 0.03,
                draw() * 0.03,
                draw() * 0.2,
            ]);
            let r = lens.unfolded_radius();
            let least = |r: f64| {
                (0..720)
                    .map(|i| DVec2::from_angle(f64::from(i) * std::f64::consts::TAU / 720.0) * r)
                    .map(|p| least_eigenvalue(lens.distort_jacobian(p)))
                    .fold(f64::INFINITY, f64::min)
            };
            for i in 0..60 {
                let inside = r.min(20.0) * (f64::from(i) + 0.5) / 60.0;
                assert!(least(inside) > 0.0, "{:?} {inside} {r}", lens.distortion);
            }
            if r < FAR {
                folded += 1;
                // Just beyond the disc there is a fold, up to the sampling of directions.
                assert!(least(r * 1.0001) < 1e-4, "{:?} {r}", lens.distortion);
            }
        }
        assert!(folded > 100, "{folded}");
    }

    #[test]
    fn distortion_is_inverted_for_lenses_that_do_not_fold() {
        let mut draw = draws(9);
        let (mut inverted, mut refused) = (0, 0);
        for _ in 0..400 {
            let lens = lens([
                draw() * 0.6,
                draw() * 0.4,
                draw() * 0.01,
                draw() * 0.01,
                draw() * 0.3,
            ]);
            if lens.folds_before().is_some() {
                refused += 1;
                continue;
            }
            inverted += 1;
            for v in (0..=489).step_by(31) {
                for u in (0..=1138).step_by(53) {
                    let px = DVec2::new(f64::from(u), f64::from(v)) - 0.5;
                    let ray = lens.ray(px);
                    let back = lens.place(ray.truncate()).unwrap_or(DVec2::NAN);
                    let error = (back - px).length();
                    assert!(error < 1e-9, "{:?} {px} {back}", lens.distortion);
                }
            }
        }
        assert!(inverted > 100 && refused > 50, "{inverted} {refused}");
    }

    /// Newton's method inverts every border pixel of this image when started from the pixel itself,
    /// but the image folds between its centre and its border.
    #[test]
    fn a_fold_between_middle_and_border_is_found() {
        let coefficients = [-9.15, -12.78, 0.0, 0.0, 285.2];
        let lens = Lens {
            focal_px: DVec2::splat(620.0),
            ..lens(coefficients)
        };
        // 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3 is negative from s = 0.037 on.
        let fold = lens.unfolded_radius();
        let slope = |r: f64| lens.distort_jacobian(DVec2::new(r, 0.0)).x_axis.x;
        assert!(slope(fold * (1.0 - 1e-6)) > 0.0 && slope(fold * (1.0 + 1e-6)) < 0.0);
        assert!(lens.folds_before().is_some());
        // Points beyond the image of the fold have no ray, although the polynomial returns there.
        let peak = lens.distort(DVec2::new(fold, 0.0)).x;
        assert!(lens.undistort(DVec2::new(peak * 1.01, 0.0)).is_nan());
        let near = lens.undistort(DVec2::new(peak * 0.99, 0.0));
        assert!(near.x > 0.0 && near.x < fold);
        let again = DVec2::new(0.45, 0.0);
        assert!(lens.contains(lens.distort_to_px(again)) && lens.place(again).is_none());
    }
}
