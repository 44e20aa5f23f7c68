// needs: bell
// A footprint's trapezoid under a Gaussian blur. Twin of `blend.rs` and of the parts of `blend.rs`.

// A Gaussian this many times as wide as a box, convolved with it, is a Gaussian of their variances'
// sum, to 2e-5 of its light left of a border. It is where differences over the box would cancel.
const SMOOTH: f32 = 2.0;

// The convolution of two boxes and a Gaussian, along one axis of the slide.
struct Blend {
    // Deviation of the Gaussian, boxes that it has swallowed and all.
    sigma: f32,
    // Widths of the boxes; 0 where the Gaussian has swallowed them.
    wide: f32,
    narrow: f32,
    // Distance from which all light lies on one side.
    end: f32,
}

// Of boxes, a deviation above 0, and how many of them matter.
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

// The part that lies left of a border at distance e from the middle.
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
