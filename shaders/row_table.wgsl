// needs: pattern_images, wide
// A pattern image that varies along one axis, averaged over footprints. Twin of `row_table.rs`,
// which describes the method; the sums are integers and identical to the CPU's.

// Widest footprint along one axis, in projector pixels.
const WIDEST: f32 = 2000.0;
const ROW_NARROWEST: f32 = 1.0 / 65536.0;
const ROW_SMALLEST: f32 = 1.0 / 512.0;
// A coordinate beyond the largest pattern image.
const LAST_PIXEL: f32 = 65536.0;
// Beyond this distance from a pattern pixel the result no longer changes; the limit keeps integer
// conversions exact.
const FAR: f32 = 2097152.0;

// Average level, 0 to 1, under the trapezoid centred at x that is the convolution of two boxes with
// the widths |slope|.
fn row_average(table: Table, x: f32, slope: vec2f) -> f32 {
    let a = clamp(abs(slope.x), ROW_SMALLEST, WIDEST);
    let b = min(abs(slope.y), WIDEST);
    let wide = max(a, b);
    let narrow = max(min(a, b), wide * ROW_NARROWEST);
    let outer = (wide + narrow) * 0.5;
    let inner = (wide - narrow) * 0.5;
    let last = i32(table.width) - 1;
    // Positions are relative to the pattern pixel at x, so that rounding scales with the footprint
    // and not with the coordinate.
    let pixel = floor(clamp(x, -0.5, LAST_PIXEL) + 0.5);
    let inside = clamp(x - pixel, -FAR, FAR);
    let offsets = vec4f(inside) + vec4f(-outer, -inner, inner, outer) + 0.5;
    let here = i32(pixel);
    // Held pixels at the trapezoid's corners, and the distance of each corner from its pixel's left
    // edge.
    let corners = clamp(here + vec4i(floor(offsets)), vec4i(0), vec4i(last));
    let t = offsets - vec4f(corners - here);
    let at = vec4u(corners) + table.first;
    let c0 = pattern_image_cells[at.x];
    let c1 = pattern_image_cells[at.y];
    let c2 = pattern_image_cells[at.z];
    let c3 = pattern_image_cells[at.w];
    if narrow < 1.0 {
        // At most one pixel edge lies in each flank. Values are relative to the lowest corner's
        // level.
        let steps = u32(corners.z - corners.x);
        let rise = f32(bitcast<i32>(c2.y - c0.y - c0.x * steps));
        let step = f32(bitcast<i32>(c2.x - c0.x));
        let low = f32(bitcast<i32>(c1.x - c0.x));
        let high = f32(bitcast<i32>(c3.x - c2.x));
        let kinks = (high * (t.w * t.w) - low * (t.y * t.y)) * (0.5 / narrow);
        let departure = rise + step * (t.z + 0.5 * narrow) + kinks;
        return (f32(c0.x) + departure / wide) * table.scale;
    }
    // Second differences, relative to the level at the centre.
    let middle = clamp(here, 0, last);
    let cell = pattern_image_cells[table.first + u32(middle)];
    let steps = corners - middle;
    let below = row_second(table.long, cell, c1, steps.y, t.y) - row_second(table.long, cell, c0, steps.x, t.x);
    let above = row_second(table.long, cell, c3, steps.w, t.w) - row_second(table.long, cell, c2, steps.z, t.z);
    return (f32(cell.x) + (above - below) / (wide * narrow)) * table.scale;
}

// Second antiderivative of the difference from the centre pixel's level, from the centre pixel's
// left edge to t beyond the left edge of the pixel `steps` further on.
fn row_second(long: bool, middle: vec4u, there: vec4u, steps: i32, t: f32) -> f32 {
    let count = bitcast<u32>(steps);
    let rise = f32(bitcast<i32>(there.y - middle.y - middle.x * count));
    let level = f32(bitcast<i32>(there.x - middle.x));
    var sums: f32;
    if long {
        let signed = wide_signed(steps);
        let line = wide_times(wide_product(2u, middle.y), signed);
        let square = wide_times(vec2u(middle.x, 0u), wide_times(signed, signed));
        let sum = wide_difference(there.zw, middle.zw);
        sums = wide_signed_to_f32(wide_difference(wide_difference(sum, line), square));
    } else {
        let sum = there.z - middle.z - 2u * middle.y * count - middle.x * count * count;
        sums = f32(bitcast<i32>(sum));
    }
    return 0.5 * sums + t * (rise + 0.5 * level * t);
}
