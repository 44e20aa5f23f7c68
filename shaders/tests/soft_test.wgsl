// needs: plan, soft
// Fractions of blurred and of sharp footprints left of an edge.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 4u * i >= arrayLength(&input) || 2u * i >= arrayLength(&output) {
        return;
    }
    let at = 4u * i;
    let slope = vec2f(bitcast<f32>(input[at]), bitcast<f32>(input[at + 1u]));
    let soft = soft_new(slope, bitcast<f32>(input[at + 2u]));
    let e = bitcast<f32>(input[at + 3u]);
    output[2u * i] = bitcast<u32>(soft_left_of(soft, e));
    output[2u * i + 1u] = bitcast<u32>(soft_sharp_left_of(soft, e));
}
