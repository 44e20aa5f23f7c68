// needs: plan, pattern_images, blend, skin_types, row_table
// Blurred footprints on a pattern image that varies along one axis. Twin of `kernel.rs`.
//
// The CPU computes the weights of pattern pixels once per state of the scene, then only sums
// products for each frame. Here the weights are recomputed in every frame: a dozen of them per
// pixel cost less than reading them from memory. Each Gaussian of a spread has its own range and
// grouping of pixels.

// Kernel reach beyond the footprint, in standard deviations. Weights are zero past KERNEL_END.
const KERNEL_REACH: f32 = 4.0;
const KERNEL_END: f32 = 6.0;
// Blur narrower than this fraction of the footprint changes a level by less than 0.05 of 255.
const KERNEL_SHARP: f32 = 2e-4;
// Minimum standard deviation of a Gaussian of a spread, in projector pixels.
const KERNEL_LEAST: f32 = 1e-6;
const MOST_GROUPS: f32 = 1024.0;
// Groups of 2^0 to 2^10 projector pixels.
const LAST_GROUPING: u32 = 10u;

// Result of `kernel_average`. `level` is valid only if `blurred` is set: otherwise the blur is too
// small to need a kernel.
struct Kernel {
    blurred: bool,
    level: f32,
}

// Average level of a footprint centred at x, under a blur with standard deviation `sigma`. Skin
// with the given tissue spreads the light further.
fn kernel_average(table: Table, x: f32, slope: vec2f, sigma: f32, tissue: u32, px_per_mm: f32) -> Kernel {
    let sizes = min(abs(slope), vec2f(WIDEST));
    let sharp = KERNEL_SHARP * max(sizes.x, sizes.y);
    // Sum of level times weight, sum of weights, and the level beyond the pattern image's end.
    var sum: vec3f;
    if has_subsurface && tissue != NO_TISSUE {
        let least = max(sharp, KERNEL_LEAST);
        for (var i = 0u; i < MOST_GAUSSIANS; i += 1u) {
            let gaussian = mixtures[tissue * MOST_GAUSSIANS + i];
            if gaussian.x == 0.0 {
                break;
            }
            let spread = gaussian.y * px_per_mm;
            let wide = max(sqrt(spread * spread + sigma * sigma), least);
            if i == 0u && wide <= sharp {
                return Kernel(false, 0.0);
            }
            let part = kernel_part(table, x, sizes, wide, gaussian.zz);
            sum = vec3f(sum.xy + gaussian.x * part.xy, part.z);
        }
    } else {
        if sigma <= sharp {
            return Kernel(false, 0.0);
        }
        sum = kernel_part(table, x, sizes, sigma, vec2f(KERNEL_REACH, KERNEL_END));
    }
    // A kernel far beyond the pattern image's end has no weight on it: use the last pixel's level.
    if sum.y < 1e-6 {
        return Kernel(true, sum.z);
    }
    return Kernel(true, sum.x / sum.y);
}

// For one Gaussian, returns the sum of level times weight on the pattern image, the sum of weights,
// and the level beyond the pattern image's end.
fn kernel_part(table: Table, x: f32, sizes: vec2f, sigma: f32, reaches: vec2f) -> vec3f {
    let blend = blend_new(sizes.x, sizes.y, sigma, reaches.y);
    let reach = reaches.x * sigma;
    var grouping = 0u;
    var group = 1.0;
    while grouping < LAST_GROUPING && (sigma >= 96.0 * group || 2.0 * reach > MOST_GROUPS * group) {
        grouping += 1u;
        group *= 2.0;
    }
    let last = (table.width + (1u << grouping) - 1u) / (1u << grouping) - 1u;
    // A position is stored as a pattern pixel plus an offset from that pixel's left edge. Relative
    // to the pattern image's left end, f32 would not resolve small blurs in distant columns.
    let pixel = floor(clamp(x, -LAST_PIXEL, LAST_PIXEL) + 0.5);
    let inside = clamp(x - pixel, -FAR, FAR) + 0.5;
    let whole = min(0.5 * (sizes.x + sizes.y) + reach, FAR);
    let here = i32(pixel);
    let low = u32(clamp((here + i32(floor(inside - whole))) >> grouping, 0, i32(last)));
    let high = u32(clamp((here + i32(floor(inside + whole))) >> grouping, 0, i32(last)));
    let start = blend_left_of(blend, -pixel - inside);
    let end = blend_left_of(blend, f32(table.width) - pixel - inside);
    let levels = pattern_image_word(table.held, grouping);
    var before = start;
    var sum = 0.0;
    for (var i = low; i <= high; i += 1u) {
        let left = clamp(blend_left_of(blend, f32(i + 1u) * group - pixel - inside), start, end);
        sum += (left - before) * held_level(table, levels + i);
        before = left;
    }
    let beyond = held_level(table, levels + min(high + 1u, last));
    return vec3f(sum + (end - before) * beyond, end - start, beyond);
}

fn held_level(table: Table, word: u32) -> f32 {
    return bitcast<f32>(pattern_image_word(table.held, word));
}
