// needs: plan
// Veiling glare. Twin of `glare.rs`, which describes the method; the weights are computed on the
// CPU.
//
// The passes run in this order: `cells`, `across`, `down`, `parts`, `whole`, `main`.

@group(0) @binding(55) var<storage, read_write> electrons: array<f32>;
@group(0) @binding(62) var<storage, read> glare: GlareSize;
// Tables: pixels that cells cover, blur weights between cells, and interpolation weights of pixels;
// floats as bits.
@group(0) @binding(63) var<storage, read> glare_tables: array<u32>;
// Means over cells.
@group(0) @binding(64) var<storage, read_write> glare_cells: array<f32>;
// The same, blurred along rows.
@group(0) @binding(65) var<storage, read_write> glare_across: array<f32>;
// Sums of electrons and of scattered electrons, each as a compensated pair. Element 0 holds the
// sums over the image, element i + 1 the sums over part i.
@group(0) @binding(66) var<storage, read_write> glare_sums: array<vec4f>;

struct GlareSize {
    width: u32,
    height: u32,
    // Number of columns and rows of cells.
    columns: u32,
    rows: u32,
    // Maximum number of pixels that a cell covers along each axis.
    span_x: u32,
    span_y: u32,
    // Starts of the tables. Coverage: for each cell, its first pixel and the weights of the pixels
    // from there on.
    cover_x: u32,
    cover_y: u32,
    // Blur: for each cell of a line, the weights of all cells of that line.
    blur_x: u32,
    blur_y: u32,
    // Interpolation: for each pixel, the cell before it and the fraction of the way to the next.
    between_x: u32,
    between_y: u32,
    // Fraction of the light that is scattered.
    share: f32,
}

// Pixels that a workgroup sums up.
const GLARE_PART: u32 = 1024u;

var<workgroup> sums: array<f32, 64>;
var<workgroup> pairs: array<vec4f, 64>;

fn glare_weight(word: u32) -> f32 {
    return bitcast<f32>(glare_tables[word]);
}

// Means of the cells: one workgroup per cell.
@compute @workgroup_size(64)
fn cells(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = group.y * groups.x + group.x;
    if cell >= glare.columns * glare.rows {
        return;
    }
    let across = glare.cover_x + (cell % glare.columns) * (glare.span_x + 1u);
    let down = glare.cover_y + (cell / glare.columns) * (glare.span_y + 1u);
    var sum = 0.0;
    for (var k = lane; k < glare.span_x * glare.span_y; k += GROUP) {
        let i = k % glare.span_x;
        let j = k / glare.span_x;
        let weight = glare_weight(across + 1u + i) * glare_weight(down + 1u + j);
        // Pixels that the cell does not cover have zero weight.
        if weight > 0.0 {
            sum += weight * electrons[(glare_tables[down] + j) * glare.width + glare_tables[across] + i];
        }
    }
    sums[lane] = sum;
    workgroupBarrier();
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        glare_cells[cell] = sums[0];
    }
}

// Blurs rows of cells.
@compute @workgroup_size(64)
fn across(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= glare.columns * glare.rows {
        return;
    }
    let weights = glare.blur_x + (i % glare.columns) * glare.columns;
    let line = i - i % glare.columns;
    var sum = 0.0;
    for (var k = 0u; k < glare.columns; k += 1u) {
        sum += glare_weight(weights + k) * glare_cells[line + k];
    }
    glare_across[i] = sum;
}

// Blurs columns of cells.
@compute @workgroup_size(64)
fn down(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= glare.columns * glare.rows {
        return;
    }
    let weights = glare.blur_y + (i / glare.columns) * glare.rows;
    let line = i % glare.columns;
    var sum = 0.0;
    for (var k = 0u; k < glare.rows; k += 1u) {
        sum += glare_weight(weights + k) * glare_across[line + k * glare.columns];
    }
    glare_cells[i] = sum;
}

// The scattered light of a pixel, interpolated between the cells' centres.
fn glare_at(i: u32) -> f32 {
    let x = glare.between_x + 2u * (i % glare.width);
    let y = glare.between_y + 2u * (i / glare.width);
    let left = glare_tables[x];
    let right = min(left + 1u, glare.columns - 1u);
    let top = glare_tables[y] * glare.columns;
    let bottom = min(glare_tables[y] + 1u, glare.rows - 1u) * glare.columns;
    let a = mix_down(top + left, bottom + left, glare_weight(y + 1u));
    let b = mix_down(top + right, bottom + right, glare_weight(y + 1u));
    return a + glare_weight(x + 1u) * (b - a);
}

fn mix_down(above: u32, below: u32, by: f32) -> f32 {
    let value = glare_cells[above];
    return value + by * (glare_cells[below] - value);
}

// Adds a value to a compensated sum: the sum and its rounding error (Knuth, TAOCP 2, section
// 4.2.2).
fn pair_sum(pair: vec2f, value: f32) -> vec2f {
    let sum = pair.x + value;
    let taken = sum - pair.x;
    return vec2f(sum, pair.y + ((pair.x - (sum - taken)) + (value - taken)));
}

fn pairs_sum(a: vec4f, b: vec4f) -> vec4f {
    let first = pair_sum(vec2f(a.x, a.y + b.y), b.x);
    let second = pair_sum(vec2f(a.z, a.w + b.w), b.z);
    return vec4f(first, second);
}

// Leaves the sum of all threads' pairs, in a fixed order, in `pairs[0]`.
fn sum_up(lane: u32, own: vec4f) {
    pairs[lane] = own;
    workgroupBarrier();
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        if lane < half {
            pairs[lane] = pairs_sum(pairs[lane], pairs[lane + half]);
        }
        workgroupBarrier();
    }
}

// Sums over parts of the image.
@compute @workgroup_size(64)
fn parts(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let part = group.y * groups.x + group.x;
    let count = glare.width * glare.height;
    let end = min((part + 1u) * GLARE_PART, count);
    var own = vec4f(0.0);
    for (var i = part * GLARE_PART + lane; i < end; i += GROUP) {
        own = vec4f(pair_sum(own.xy, electrons[i]), pair_sum(own.zw, glare_at(i)));
    }
    sum_up(lane, own);
    if lane == 0u && part * GLARE_PART < count {
        glare_sums[part + 1u] = pairs[0];
    }
}

// Sums over the parts: one workgroup.
@compute @workgroup_size(64)
fn whole(@builtin(local_invocation_index) lane: u32) {
    let count = (glare.width * glare.height + GLARE_PART - 1u) / GLARE_PART;
    var own = vec4f(0.0);
    for (var i = lane; i < count; i += GROUP) {
        own = pairs_sum(own, glare_sums[i + 1u]);
    }
    sum_up(lane, own);
    if lane == 0u {
        glare_sums[0] = pairs[0];
    }
}

// Adds each pixel's scattered light, scaled so that the total is preserved.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= glare.width * glare.height {
        return;
    }
    let sum = glare_sums[0];
    var kept = 0.0;
    if sum.z > 0.0 {
        kept = (sum.x + sum.y) / (sum.z + sum.w) * glare.share;
    }
    electrons[i] = electrons[i] * (1.0 - glare.share) + kept * glare_at(i);
}
