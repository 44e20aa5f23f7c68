// needs: plan, material_values
//
// Twin of `Soft` in exposure/bell.rs: a footprint's trapezoid under a Gaussian blur.
//
// The CPU takes second differences of the second antiderivative of the normal distribution, which
// would cancel in f32. Here only the change due to blur is looked up: g(z) = phi(z) - z Phi(-z),
// the difference between the blurred and the sharp ramp, and its antiderivative H. For large z, g
// vanishes and H is constant.

// The table holds, at z = i / 16, i from 0 to 96: H(z), g(z), Phi(-z).
const SOFT_FINE: f32 = 16.0;
const SOFT_LAST: u32 = 95u;
const SOFT_END: f32 = 6.0;
// A box narrower than this many standard deviations is averaged with three points.
const SOFT_NARROW: f32 = 0.5;

// The convolution of two boxes and a Gaussian.
struct Soft {
    sigma: f32,
    wide: f32,
    narrow: f32,
}

// Boxes with the widths |slope|, and a standard deviation above 0.
fn soft_new(slope: vec2f, sigma: f32) -> Soft {
    let a = abs(slope.x);
    let b = abs(slope.y);
    let wide = max(max(a, b), 1e-3 * sigma);
    let narrow = min(max(max(min(a, b), 1e-3 * sigma), 1e-6 * wide), wide);
    return Soft(sigma, wide, narrow);
}

// Fraction that lies left of an edge at distance e from the centre.
fn soft_left_of(soft: Soft, e: f32) -> f32 {
    return soft_sharp_left_of(soft, e) + soft_beyond(soft, e);
}

// The same for the sharp trapezoid, which is symmetric: computed from the side with the smaller
// fraction.
fn soft_sharp_left_of(soft: Soft, e: f32) -> f32 {
    let less = soft_mean_ramp(0.5 * soft.wide - abs(e), soft.narrow) / soft.wide;
    return select(less, 1.0 - less, e > 0.0);
}

// Change of the fraction due to blur.
fn soft_beyond(soft: Soft, e: f32) -> f32 {
    let far = 0.5 * soft.wide;
    let narrow = soft.narrow / soft.sigma;
    let right = soft_mean_rest((e + far) / soft.sigma, narrow);
    let left = soft_mean_rest((e - far) / soft.sigma, narrow);
    return (right - left) * (soft.sigma / soft.wide);
}

// Mean of max(x, 0) over an interval around a centre.
fn soft_mean_ramp(middle: f32, wide: f32) -> f32 {
    let half = 0.5 * wide;
    if abs(middle) >= half {
        return max(middle, 0.0);
    }
    let beyond = middle + half;
    return 0.5 * beyond * (beyond / wide);
}

// Mean of g(|z|) over an interval around a centre.
fn soft_mean_rest(middle: f32, wide: f32) -> f32 {
    let half = 0.5 * wide;
    if wide >= SOFT_NARROW {
        return (soft_integral(middle + half) - soft_integral(middle - half)) / wide;
    }
    let off = abs(middle);
    if off >= half {
        return soft_mean(off, half);
    }
    // g(|z|) has a kink at 0: integrate each side separately.
    let right = 0.5 * (half + off);
    let left = 0.5 * (half - off);
    return (right * soft_mean(right, right) + left * soft_mean(left, left)) / half;
}

// Mean of g over a narrow interval, by three-point Gauss-Legendre quadrature.
fn soft_mean(middle: f32, half: f32) -> f32 {
    let off = 0.7745967 * half;
    let rim = soft_at(max(middle - off, 0.0)).y + soft_at(middle + off).y;
    return (5.0 * rim + 8.0 * soft_at(middle).y) / 18.0;
}

// Integral of g(|z|) from 0.
fn soft_integral(z: f32) -> f32 {
    return sign(z) * soft_at(abs(z)).x;
}

// H and g at z >= 0, by cubic Hermite interpolation.
fn soft_at(z: f32) -> vec2f {
    if z >= SOFT_END {
        return vec2f(material_values[SOFT_AT + 3u * (SOFT_LAST + 1u)], 0.0);
    }
    let place = z * SOFT_FINE;
    let i = min(u32(place), SOFT_LAST);
    let t = place - f32(i);
    let a = material_value3(SOFT_AT + 3u * i);
    let b = material_value3(SOFT_AT + 3u * (i + 1u));
    let step = 1.0 / SOFT_FINE;
    // The derivative of H is g, that of g is -Phi(-z).
    let slope_a = vec2f(a.y, -a.z) * step;
    let slope_b = vec2f(b.y, -b.z) * step;
    let s = 1.0 - t;
    let blend = a.xy * (s * s * (1.0 + 2.0 * t)) + b.xy * (t * t * (1.0 + 2.0 * s));
    return blend + slope_a * (t * s * s) - slope_b * (s * t * t);
}
