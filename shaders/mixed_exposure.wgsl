// needs: plan, mixed_in, skin_in, footprint, flicker
// The exposure of mixed pixels: the mean over their samples. Twin of `mixed` in
// `exposure/pass.rs` and in `schedule.rs`.
//
// A workgroup takes 64 groups of samples, sixteen threads each, so that samples are read side by
// side; then each thread adds up one group in the order of its samples.

@group(0) @binding(55) var<storage, read_write> electrons: array<f32>;
// Electrons of each group of samples.
@group(0) @binding(60) var<storage, read_write> mixed_electrons: array<f32>;

// Whether to add the light to that of other instants already in the buffer.
override adds: bool = false;

// Stride between the products of consecutive groups, chosen so that they lie in different memory
// banks.
const MIXED_STEP: u32 = MIXED_LANES + 1u;

var<workgroup> products: array<f32, 1088>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = (group.y * groups.x + group.x) * GROUP;
    let count = mixed_count[0];
    let k = lane % MIXED_LANES;
    for (var own = lane / MIXED_LANES; own < GROUP; own += GROUP / MIXED_LANES) {
        var product = 0.0;
        if first + own < count {
            product = mixed_product(first + own, k);
        }
        products[own * MIXED_STEP + k] = product;
    }
    workgroupBarrier();
    if first + lane >= count {
        return;
    }
    let head = mixed_heads[first + lane];
    let line = schedule_line(head.x);
    var seconds = 0.0;
    for (var i = 0u; i < line.parts; i += 1u) {
        seconds += schedule_part(line.first + i).seconds;
    }
    var sum = 0.0;
    for (var i = 0u; i < MIXED_LANES; i += 1u) {
        sum += products[lane * MIXED_STEP + i];
    }
    var mean = seconds * bitcast<f32>(head.z) + sum / f32(MIXED_LANES);
    if has_flicker {
        mean = flicker_both(mean, line.swing, bitcast<f32>(head.w));
    }
    mixed_electrons[first + lane] = mean;
}

// Light of the pattern images at one sample.
fn mixed_product(head: u32, k: u32) -> f32 {
    let number = head * MIXED_LANES + k;
    let sample = mixed_samples[number];
    if sample.projected <= 0.0 {
        return 0.0;
    }
    var footprint = Footprint(
        sample.place,
        vec4f(sample.slopes_x, sample.slopes_y),
        sample.blur,
        NO_TISSUE,
        vec2f(0.0),
    );
    if has_subsurface {
        footprint.px_per_mm = mixed_skin[number].px_per_mm;
        footprint.tissue = mixed_skin[number].tissue;
    }
    let line = schedule_line(mixed_heads[head].x);
    var sum = 0.0;
    for (var i = 0u; i < line.parts; i += 1u) {
        let part = schedule_part(line.first + i);
        if part.power > 0.0 {
            sum += part.seconds * part.power * footprint_level(schedule_table(part.table), footprint);
        }
    }
    return sample.projected * sum;
}

// Sums the groups of each pixel, in order.
@compute @workgroup_size(64)
fn pixels(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= mixed_count[0] || mixed_heads[i].y == 0u {
        return;
    }
    let head = mixed_heads[i];
    var sum = 0.0;
    for (var k = 0u; k < head.y; k += 1u) {
        sum += mixed_electrons[i + k];
    }
    if adds {
        sum += electrons[head.x];
    }
    electrons[head.x] = sum;
}
