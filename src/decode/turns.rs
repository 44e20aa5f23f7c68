//! The angle of a vector in turns, branch-free so that it vectorises.

/// atan(q) / (2 pi q) as a polynomial in q^2 on [0, tan^2(pi/8)]: Chebyshev interpolation of degree
/// 4, with an error of at most 7e-9 rad before rounding.
const ATAN: [f32; 5] = [
    0.159_154_94,
    -0.053_050_794,
    0.031_790_253,
    -0.022_045_313,
    0.012_708_463,
];
const TAN_PI_8: f32 = 0.414_213_57;

/// atan2(s, c) / (2 pi), reduced to [0, 1). The error is below 1e-6 rad (see the test); (0, 0) gives
/// 0.
#[inline(always)]
pub(super) fn turns(s: f32, c: f32) -> f32 {
    let (ac, as_) = (c.abs(), s.abs());
    let (big, small) = (ac.max(as_), ac.min(as_));
    // Beyond pi/8 the angle is measured from pi/4: tan(a - pi/4) = (tan a - 1) / (tan a + 1).
    let far = small > TAN_PI_8 * big;
    let num = if far { small - big } else { small };
    let den = if far { small + big } else { big };
    let q = num / den.max(f32::MIN_POSITIVE);
    let z = q * q;
    let poly = ATAN[0] + z * (ATAN[1] + z * (ATAN[2] + z * (ATAN[3] + z * ATAN[4])));
    let mut t = q * poly + if far { 0.125 } else { 0.0 };
    t = if as_ > ac { 0.25 - t } else { t };
    t = if c < 0.0 { 0.5 - t } else { t };
    t = if s < 0.0 { 1.0 - t } else { t };
    if t >= 1.0 { 0.0 } else { t }
}

/// Rounds to the nearest integer (ties to even) for |v| < 2^22. Vectorises without the SSE4.1
/// rounding instruction.
#[inline(always)]
pub(super) fn nearest(v: f32) -> f32 {
    const MAGIC: f32 = 12_582_912.0;
    (v + MAGIC) - MAGIC
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn angle_matches_f64_all_around_and_at_all_sizes() {
        let mut worst = 0.0_f64;
        for i in 0..200_000 {
            let angle = TAU * f64::from(i) / 200_000.0;
            let size = 10f64.powi(i % 11 - 5);
            let (s, c) = ((size * angle.sin()) as f32, (size * angle.cos()) as f32);
            let truth = f64::from(s).atan2(f64::from(c)) / TAU;
            let off = f64::from(turns(s, c)) - truth;
            worst = worst.max((off - off.round()).abs() * TAU);
            assert!((0.0..1.0).contains(&turns(s, c)));
        }
        assert!(worst < 1e-6, "{worst:e} rad");
    }

    #[test]
    fn axes_are_exact() {
        for (s, c, t) in [
            (0.0, 3.0, 0.0),
            (-0.0, 3.0, 0.0),
            (2.0, 0.0, 0.25),
            (0.0, -1.0, 0.5),
            (-7.0, 0.0, 0.75),
            (0.0, 0.0, 0.0),
        ] {
            assert_eq!(turns(s, c), t, "{s} {c}");
        }
    }

    #[test]
    fn nearest_rounds_like_round() {
        for v in [-3.7f32, -0.4, 0.0, 0.49, 1.51, 119.6] {
            assert_eq!(nearest(v), v.round());
        }
    }
}
