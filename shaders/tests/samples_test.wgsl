// needs: plan, aperture, sheared
// Positions of samples in the pixel and in the pupil, and footprints widened by depth of field.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<vec4f>;

// For a pixel's kth sample: its point of the pupil, and its position relative to the pixel's
// centre.
@compute @workgroup_size(64)
fn places(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i < arrayLength(&output) {
        let k = input[4u * i + 2u];
        let point = pupil_point(vec2u(input[4u * i], input[4u * i + 1u]), k);
        output[i] = vec4f(point.xy, sheared(k, input[4u * i + 3u]));
    }
}

// For a footprint of two widths and a depth: the blur disc's radius, and the widened widths.
@compute @workgroup_size(64)
fn widths(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i < arrayLength(&output) {
        let slope = vec2f(bitcast<f32>(input[4u * i]), bitcast<f32>(input[4u * i + 1u]));
        let radius = disc_px(bitcast<f32>(input[4u * i + 2u]));
        output[i] = vec4f(widened(slope, radius), radius, 0.0);
    }
}
