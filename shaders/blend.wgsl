// needs: bell
// A footprint's trapezoid under a Gaussian blur. Twin of `blend.rs`.

// A Gaussian at least this many times as wide as a box, convolved with that box, is replaced by a
// Gaussian with the sum of their variances; the fraction of light left of an edge is then accurate
// to 2e-5. For such wide Gaussians, differences over the box would cancel.
const SMOOTH: f32 = 2.0;

// The convolution of two boxes and a Gaussian, along one axis of the pattern image.
struct Blend {
    // Standard deviation of the Gaussian, including the boxes merged into it.
    sigma: f32,
    // Widths of the boxes; 0 for a box that has been merged into the Gaussian.
    wide: f32,
    narrow: f32,
    // Distance from which all the light lies on one side.
    end: f32,
}

// Blend of two boxes and a Gaussian with standard deviation `sigma` > 0, cut off `reach` standard
// deviations beyond the boxes.
fn blend_new(a: f32, b: f32, sigma: f32, reach: f32) -> Blend {
    var blend = Blend(sigma, max(a, b), min(a, b), 0.5 * (a + b) + reach * sigma);
    var swallowed = 0.0;
    if sigma >= SMOOTH * blend.narrow {
        swallowed = blend.narrow * blend.narrow;
        blend.narrow = 0.0;
    }
    if sigma >= SMOOTH * blend.wide {
        swallowed += blend.wide * blend.wide;
        blend.wide = 0.0;
    }
    blend.sigma = sqrt(sigma * sigma + swallowed / 12.0);
    return blend;
}

// Fraction of the light that lies left of an edge at distance e from the centre.
fn blend_left_of(blend: Blend, e: f32) -> f32 {
    if abs(e) > blend.end {
        return select(0.0, 1.0, e > 0.0);
    }
    if blend.wide == 0.0 {
        return bell_second(e / blend.sigma);
    }
    if blend.narrow == 0.0 {
        let half = 0.5 * blend.wide;
        let sharp = clamp(e / blend.wide, -0.5, 0.5) + 0.5;
        let rest = bell_first((e + half) / blend.sigma) - bell_first((e - half) / blend.sigma);
        return sharp + rest * (blend.sigma / blend.wide);
    }
    let outer = 0.5 * (blend.wide + blend.narrow);
    let inner = 0.5 * (blend.wide - blend.narrow);
    let flank = clamp(abs(e) - inner, 0.0, blend.narrow);
    let beside = min(abs(e), inner) + flank * (1.0 - 0.5 * flank / blend.narrow);
    let sharp = 0.5 + sign(e) * beside / blend.wide;
    let per = 1.0 / blend.sigma;
    let above = bell_value((e + outer) * per) - bell_value((e + inner) * per);
    let below = bell_value((e - inner) * per) - bell_value((e - outer) * per);
    return sharp + (above - below) * (blend.sigma / blend.wide) * (blend.sigma / blend.narrow);
}
