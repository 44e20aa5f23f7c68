// needs: row_table
// A pattern image with a two-dimensional pattern, averaged over footprints. Twin of
// `image_table.rs`.
//
// The CPU takes differences of large sums in f64, interpolated between corners. Here sums are
// integers, and their exact differences are sums of levels over blocks of whole pixels: the
// rectangle's first column, its inner columns and its last column, combined with the same for rows.
// Blocks are weighted by the fraction of them that the rectangle covers, so that nothing is
// subtracted in floating point, and the only f32 error is that of the weights. Positions are
// relative to the pattern pixel at the centre.

const PARTS_PER_PX: f32 = 2.0;
const IMAGE_PARTS: f32 = 8.0;
// A box with the variance of a Gaussian is sqrt(12) standard deviations wide.
const BOX_OF_DEVIATION: f32 = 3.4641016;
// Upper limit of a footprint's slope: the parts of steeper ones lie beyond any pattern image.
const STEEPEST: f32 = 1e6;

// Average level, 0 to 1, over the parallelogram of a footprint, with the slopes of x, then of y,
// under a blur with standard deviations along columns and rows.
fn image_average(table: Table, at: vec2f, slope: vec4f, deviation: vec2f) -> f32 {
    let slopes = clamp(slope, vec4f(-STEEPEST), vec4f(STEEPEST));
    let sizes = abs(slopes);
    let slant = max(min(sizes.x, sizes.y), min(sizes.z, sizes.w));
    let parts = clamp(ceil(slant * PARTS_PER_PX), 1.0, IMAGE_PARTS);
    let narrow = 1.0 / parts;
    let box = vec2f(length(slopes.xy), length(slopes.zw)) * narrow;
    let more = deviation * BOX_OF_DEVIATION;
    let size = clamp(sqrt(box * box + more * more), vec2f(1e-3), vec2f(WIDEST));
    let pixel = floor(clamp(at, vec2f(-0.5), vec2f(LAST_PIXEL)) + 0.5);
    let inside = clamp(at - pixel, vec2f(-FAR), vec2f(FAR));
    var sum = 0.0;
    for (var v = 0.5; v < parts; v += 1.0) {
        for (var u = 0.5; u < parts; u += 1.0) {
            let along = vec2f(u, v) * narrow - 0.5;
            let off = vec2f(dot(along, slopes.xy), dot(along, slopes.zw));
            sum += image_rectangle(table, pixel, inside + off, size);
        }
    }
    return sum * (narrow * narrow) * table.scale;
}

// Extent of a rectangle along one axis: its first and last pixel, and the covered fractions of the
// first pixel, of each inner pixel and of the last pixel, divided by the rectangle's length.
struct Cover {
    first: u32,
    last: u32,
    weights: vec3f,
}

fn image_cover(pixel: f32, middle: f32, size: f32, count: u32) -> Cover {
    // Relative to the left edge of `pixel`.
    let end = f32(count) - pixel;
    let low = clamp(middle + 0.5 - 0.5 * size, -pixel, end - 1e-3);
    let high = min(max(middle + 0.5 + 0.5 * size, low + 1e-3), end);
    let here = i32(pixel);
    let most = i32(count) - 1;
    let first = clamp(here + i32(floor(low)), 0, most);
    let last = clamp(here + i32(floor(high)), first, most);
    if first == last {
        return Cover(u32(first), u32(last), vec3f(1.0, 0.0, 0.0));
    }
    let start = 1.0 - (low - f32(first - here));
    let rest = high - f32(last - here);
    let whole = start + f32(last - first - 1) + rest;
    return Cover(u32(first), u32(last), vec3f(start, 1.0, rest) / max(whole, 1e-6));
}

// Mean level over a rectangle; `middle` is its centre relative to the centre of `pixel`.
fn image_rectangle(table: Table, pixel: vec2f, middle: vec2f, size: vec2f) -> f32 {
    let x = image_cover(pixel.x, middle.x, size.x, table.width);
    let y = image_cover(pixel.y, middle.y, size.y, table.height);
    let a = image_line(table, x, y.first);
    let b = image_line(table, x, y.first + 1u);
    let c = image_line(table, x, y.last);
    let d = image_line(table, x, y.last + 1u);
    return y.weights.x * image_between(a, b, x.weights)
        + y.weights.y * image_between(b, c, x.weights)
        + y.weights.z * image_between(c, d, x.weights);
}

// Sums of all levels above a boundary between rows, as two words: in the first column, in the inner
// columns and in the last column.
struct Sums {
    low: vec3u,
    high: vec3u,
}

fn image_line(table: Table, x: Cover, row: u32) -> Sums {
    let start = row * (table.width + 1u);
    let at = start + vec4u(x.first, x.first + 1u, x.last, x.last + 1u);
    if table.long {
        let a = image_corner(table, at.x);
        let b = image_corner(table, at.y);
        let c = image_corner(table, at.z);
        let d = image_corner(table, at.w);
        let first = wide_difference(b, a);
        let whole = wide_difference(c, b);
        let last = wide_difference(d, c);
        return Sums(vec3u(first.x, whole.x, last.x), vec3u(first.y, whole.y, last.y));
    }
    let a = pattern_image_word(table.first, at.x);
    let b = pattern_image_word(table.first, at.y);
    let c = pattern_image_word(table.first, at.z);
    let d = pattern_image_word(table.first, at.w);
    return Sums(vec3u(b - a, c - b, d - c), vec3u(0u));
}

fn image_corner(table: Table, corner: u32) -> vec2u {
    return vec2u(pattern_image_word(table.first, 2u * corner), pattern_image_word(table.first, 2u * corner + 1u));
}

// Weighted sum of the blocks between two boundaries. For a kind of block that the rectangle lacks,
// the difference is meaningless, but its weight is zero.
fn image_between(above: Sums, below: Sums, weights: vec3f) -> f32 {
    let low = below.low - above.low;
    let high = below.high - above.high - vec3u(below.low < above.low);
    return dot(weights, vec3f(high) * 4294967296.0 + vec3f(low));
}
