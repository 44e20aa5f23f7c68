// The normal distribution and its antiderivatives. Twin of `bell.rs`, whose table it reads.
//
// G, with G'' = Phi, grows quadratically, and footprints need its second differences, which would
// cancel in f32. G is therefore split into that of a sharp edge, max(z, 0)^2 / 2, which the caller
// evaluates in closed form, and a remainder below 1/2. By symmetry the left half of the table,
// where all values are small, is enough.

// Two vectors for each piece: the coefficients of a quintic on [0, 1].
@group(0) @binding(58) var<storage, read> bell: array<vec4f>;

// The table starts at -BELL_END and has BELL_FINE intervals per unit.
const BELL_END: f32 = 6.0;
const BELL_FINE: f32 = 16.0;

struct Piece {
    low: vec4f,
    high: vec2f,
    t: f32,
}

// The piece that contains -|z|, clamped to [-BELL_END, 0].
fn bell_piece(z: f32) -> Piece {
    let place = (BELL_END - abs(z)) * BELL_FINE;
    let i = clamp(floor(place), 0.0, BELL_END * BELL_FINE - 1.0);
    let at = 2u * u32(i);
    return Piece(bell[at], bell[at + 1u].xy, place - i);
}

// G(z) - max(z, 0)^2 / 2.
fn bell_value(z: f32) -> f32 {
    var value = 0.0;
    if abs(z) < BELL_END {
        let c = bell_piece(z);
        let t = c.t;
        value = c.low.x + t * (c.low.y + t * (c.low.z + t * (c.low.w + t * (c.high.x + t * c.high.y))));
    }
    return select(value, 0.5 - value, z > 0.0);
}

// G'(z) - max(z, 0).
fn bell_first(z: f32) -> f32 {
    if abs(z) >= BELL_END {
        return 0.0;
    }
    let c = bell_piece(z);
    let t = c.t;
    let first = c.low.y + t * (2.0 * c.low.z + t * (3.0 * c.low.w + t * (4.0 * c.high.x + t * 5.0 * c.high.y)));
    return first * BELL_FINE;
}

// Phi(z).
fn bell_second(z: f32) -> f32 {
    var second = 0.0;
    if abs(z) < BELL_END {
        let c = bell_piece(z);
        let t = c.t;
        second = 2.0 * c.low.z + t * (6.0 * c.low.w + t * (12.0 * c.high.x + t * 20.0 * c.high.y));
        second *= BELL_FINE * BELL_FINE;
    }
    return select(second, 1.0 - second, z > 0.0);
}
