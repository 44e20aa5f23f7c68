// needs: mixed_types, sampling
// Depth of field: models the camera's pupil as a disc instead of a point. Twin of
// `transport/aperture.rs`.

// Blur discs with a smaller radius, in pixels, are ignored.
const SHARP_PX: f32 = 1e-3;
// Upper limit of the blur radius: the disc of a point that touches the pupil would be infinite.
const LARGEST_PX: f32 = 1e6;

// The pupil is a disc: rays start at points spread over it.
override through_pupil: bool = false;

// Radius in pixel widths of the blur disc of a point at a depth in millimetres.
fn disc_px(depth: f32) -> f32 {
    if depth <= 0.0 {
        return 0.0;
    }
    return min(sampling.spread * abs(1.0 / depth - sampling.focus), LARGEST_PX);
}

// The point of the pupil at which a pixel's kth sample starts.
fn pupil_point(pixel: vec2u, k: u32) -> vec3f {
    let across = MIXED_LANES / sampling.rows;
    let tiles = (sampling.size.x + across - 1u) / across;
    let tile = pixel.y / sampling.rows * tiles + pixel.x / across;
    // Each tile rotates the points, so that neighbouring tiles do not share them.
    let turn = bitcast<vec2f>(sampling.tables[sampling.turns + tile]);
    let at = bitcast<vec2f>(sampling.tables[k]);
    return vec3f(at.x * turn.x - at.y * turn.y, at.x * turn.y + at.y * turn.x, 0.0);
}

// Converts the direction, with z = 1, of the ray through the pupil's centre into that of the ray
// through another point of the pupil.
fn through(point: vec3f, direction: vec3f) -> vec3f {
    return direction - point * sampling.focus;
}

// Widths of two boxes whose convolution approximates a footprint (itself the convolution of two
// boxes) convolved with a disc of a radius in pixel widths. It is the CPU's closed form, with widths
// in units of sqrt(a^2 + b^2) and differences of nearly equal numbers expanded by hand; r is the
// disc's radius along the pattern image's axis, radius |(a, aspect b)|:
// (w1^2 - w2^2)^2 = (a^2 - b^2)^2 + 6 r^2 (r^2 - 1) and w1^2 w2^2 = a^2 b^2 + 3 r^2 + 3/4 r^4.
// Twin of `widened`.
fn widened(slope: vec2f, radius_px: f32) -> vec2f {
    let scale = abs(slope.x) + abs(slope.y);
    if !(radius_px > SHARP_PX) || scale == 0.0 {
        return slope;
    }
    let parts = slope / scale;
    let whole = dot(parts, parts);
    let a = parts.x * parts.x / whole;
    let b = parts.y * parts.y / whole;
    let aspect = sampling.pixel_aspect;
    let r = radius_px * radius_px * (1.0 + (aspect * aspect - 1.0) * b);
    let apart = sqrt(max((a - b) * (a - b) + 6.0 * r * (r - 1.0), 0.0));
    let square = (1.0 + 3.0 * r + apart) / 2.0;
    var both = vec2f(square);
    if apart > 0.0 {
        both.y = (a * b + r * (3.0 + 0.75 * r)) / square;
    }
    let wide = sqrt(both) * (scale * sqrt(whole));
    return select(wide.yx, wide, a >= b);
}
