// needs: plan, wide
// Input: two 64-bit numbers. Output: their difference, their product and the first as f32.

@group(0) @binding(110) var<storage, read> input: array<vec4u>;
@group(0) @binding(111) var<storage, read_write> output: array<vec4u>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 2u * i + 1u >= arrayLength(&output) || i >= arrayLength(&input) {
        return;
    }
    let a = input[i].xy;
    let b = input[i].zw;
    output[2u * i] = vec4u(wide_difference(a, b), wide_times(a, b));
    let numbers = vec2f(wide_to_f32(a), wide_signed_to_f32(a));
    output[2u * i + 1u] = vec4u(bitcast<vec2u>(numbers), 0u, 0u);
}
