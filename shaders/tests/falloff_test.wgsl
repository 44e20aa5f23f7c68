// needs: plan, vignetting, defocus
// Vignetting factors of both lenses at ideal image points; the projector's blur at points, and the
// fraction of the light that it leaves near the pattern image's edge.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 11u * i >= arrayLength(&input) || 4u * i >= arrayLength(&output) {
        return;
    }
    var values: array<f32, 11>;
    for (var k = 0u; k < 11u; k++) {
        values[k] = bitcast<f32>(input[11u * i + k]);
    }
    let ideal = vec2f(values[0], values[1]);
    let point = vec3f(values[2], values[3], values[4]);
    var shaded: Shaded;
    shaded.reachable = true;
    shaded.projected = 1.0;
    shaded.px = vec2f(values[5], values[6]);
    shaded.footprint = vec4f(values[7], values[8], values[9], values[10]);
    dim_border(point, &shaded);
    output[4u * i] = bitcast<u32>(falloff_at(optics[0].seen, ideal));
    output[4u * i + 1u] = bitcast<u32>(falloff_at(optics[0].shown, ideal));
    output[4u * i + 2u] = bitcast<u32>(blur_px(point));
    output[4u * i + 3u] = bitcast<u32>(shaded.projected);
}
