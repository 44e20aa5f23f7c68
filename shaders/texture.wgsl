// needs: plan
//
// Twin of material/texture.rs: a texture as albedo, averaged over a pixel's footprint with a
// summed-area table. The sums are integers in units of 2^-30, in two words, so that their
// differences are exact. A rectangle is composed of whole texels and fractions of the texels at its
// rim; differences of interpolated f32 sums would not be accurate enough.

// Sums over the texels left of and above each of the (width + 1) x (height + 1) corners, low word
// first.
@group(0) @binding(33) var<storage, read> texel_sums: array<vec2u>;

// Minimum and maximum number of pieces along a side of a slanted footprint, and pieces per texel in
// between.
const PIECES_FEWEST: f32 = 4.0;
const PIECES_MOST: f32 = 8.0;
const PIECES_PER_TEXEL: f32 = 3.0;
// A footprint slanted by less than this many texels is treated as a rectangle.
const STRAIGHT: f32 = 1e-2;
// Narrowest footprint in texels.
const NARROWEST: f32 = 1e-3;
// Maximum footprint in texels; for wider or non-finite footprints the result is the texture's mean.
const WIDEST_FOOTPRINT: f32 = 1e8;

struct Picture {
    // Index of its first corner sum in `texel_sums`.
    sums: u32,
    width: u32,
    height: u32,
    mean: f32,
}

// Mean over the parallelogram centred at `uv` with sides `across` and `down`, in units of the
// texture.
fn texture_average(image: Picture, uv: vec2f, across: vec2f, down: vec2f) -> f32 {
    let size = vec2f(f32(image.width), f32(image.height));
    let a = across * size;
    let b = down * size;
    let extent = vec2f(length(vec2f(a.x, b.x)), length(vec2f(a.y, b.y)));
    if !(max(extent.x, extent.y) <= WIDEST_FOOTPRINT) {
        return image.mean;
    }
    let center = fract(uv) * size;
    let slant = min(max(abs(a.x), abs(b.y)), max(abs(a.y), abs(b.x)));
    var n = 1u;
    if slant >= STRAIGHT {
        let wanted = ceil(max(extent.x, extent.y) * PIECES_PER_TEXEL);
        n = u32(clamp(wanted, PIECES_FEWEST, PIECES_MOST));
    }
    let part = 1.0 / f32(n);
    let sides = max(extent * part, vec2f(NARROWEST));
    var sum = 0.0;
    for (var k = 0u; k < n * n; k++) {
        let s = (f32(k % n) + 0.5) * part - 0.5;
        let t = (f32(k / n) + 0.5) * part - 0.5;
        sum += texture_rectangle(image, center + a * s + b * t, sides);
    }
    return sum * part * part;
}

// Mean over an axis-aligned rectangle: whole repeats of the texture, and the rest.
fn texture_rectangle(image: Picture, center: vec2f, sides: vec2f) -> f32 {
    let size = vec2f(f32(image.width), f32(image.height));
    let corner = center - 0.5 * sides;
    let low = clamp(corner - floor(corner / size) * size, vec2f(0.0), size);
    let whole = floor(sides / size);
    if whole.x == 0.0 && whole.y == 0.0 {
        return texture_part(image, low, sides);
    }
    let rest = clamp(sides - whole * size, vec2f(0.0), size);
    var mean = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let is_rest = vec2<bool>((k & 1u) != 0u, (k & 2u) != 0u);
        let wide = select(size, rest, is_rest);
        let share = select(whole * size, rest, is_rest) / sides;
        if share.x * share.y > 0.0 {
            mean += share.x * share.y * texture_part(image, select(vec2f(0.0), low, is_rest), wide);
        }
    }
    return mean;
}

// An interval along one axis, split into a fraction of a texel, whole texels, and a fraction of a
// texel.
struct Stretch {
    first: u32,
    last: u32,
    first_part: f32,
    last_part: f32,
}

fn texture_stretch(low: f32, wide: f32, texels: u32) -> Stretch {
    let first = min(u32(low), texels - 1u);
    let last = clamp(u32(low + wide), first, 2u * texels - 1u);
    if last == first {
        return Stretch(first, last, wide, 0.0);
    }
    return Stretch(first, last, f32(first + 1u) - low, min(low + wide - f32(last), 1.0));
}

// First and end texel of a piece of an interval, and the weight of each.
fn texture_piece(stretch: Stretch, k: u32) -> vec2u {
    switch k {
        case 0u: { return vec2u(stretch.first, stretch.first + 1u); }
        case 1u: { return vec2u(stretch.first + 1u, max(stretch.last, stretch.first + 1u)); }
        default: { return vec2u(stretch.last, stretch.last + 1u); }
    }
}

fn texture_weight(stretch: Stretch, k: u32) -> f32 {
    return select(select(stretch.last_part, 1.0, k == 1u), stretch.first_part, k == 0u);
}

// Mean over a rectangle that starts in the texture and is at most as large as the texture.
fn texture_part(image: Picture, low: vec2f, sides: vec2f) -> f32 {
    let x = texture_stretch(low.x, sides.x, image.width);
    let y = texture_stretch(low.y, sides.y, image.height);
    var sum = 0.0;
    var area = 0.0;
    for (var j = 0u; j < 3u; j++) {
        let rows = texture_piece(y, j);
        let down = texture_weight(y, j);
        for (var i = 0u; i < 3u; i++) {
            let columns = texture_piece(x, i);
            let weight = texture_weight(x, i) * down;
            let texels = (columns.y - columns.x) * (rows.y - rows.x);
            if weight > 0.0 && texels > 0u {
                sum += weight * texture_block(image, columns, rows);
                area += weight * f32(texels);
            }
        }
    }
    return select(image.mean, sum / area, area > 0.0);
}

// Sum over whole texels.
fn texture_block(image: Picture, columns: vec2u, rows: vec2u) -> f32 {
    let right = sums_minus(
        texture_corner(image, columns.y, rows.y), texture_corner(image, columns.y, rows.x));
    let left = sums_minus(
        texture_corner(image, columns.x, rows.y), texture_corner(image, columns.x, rows.x));
    let found = sums_minus(right, left);
    // Rounding may have made the difference slightly negative.
    return f32(bitcast<i32>(found.y)) * 4.0 + f32(found.x) * 0x1p-30;
}

// Sum from the origin to a corner of the texture or of its first repeat.
fn texture_corner(image: Picture, x: u32, y: u32) -> vec2u {
    let over = x > image.width;
    let below = y > image.height;
    let column = select(x, x - image.width, over);
    let row = select(y, y - image.height, below);
    var sum = texture_sum(image, column, row);
    if over {
        sum = sums_plus(sum, texture_sum(image, image.width, row));
    }
    if below {
        sum = sums_plus(sum, texture_sum(image, column, image.height));
    }
    if over && below {
        sum = sums_plus(sum, texture_sum(image, image.width, image.height));
    }
    return sum;
}

fn texture_sum(image: Picture, column: u32, row: u32) -> vec2u {
    return texel_sums[image.sums + row * (image.width + 1u) + column];
}

fn sums_plus(a: vec2u, b: vec2u) -> vec2u {
    let low = a.x + b.x;
    return vec2u(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn sums_minus(a: vec2u, b: vec2u) -> vec2u {
    return vec2u(a.x - b.x, a.y - b.y - select(0u, 1u, a.x < b.x));
}
