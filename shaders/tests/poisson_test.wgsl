// needs: plan, poisson
// Input: the bits of a mean, and a word. Output: the Poisson number, and the probability and sign
// of the word's remainder.

@group(0) @binding(110) var<storage, read> input: array<vec2u>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= arrayLength(&input) {
        return;
    }
    let mean = bitcast<f32>(input[i].x);
    let drawn = poisson(mean, input[i].y);
    output[4u * i] = bitcast<u32>(drawn.number);
    output[4u * i + 1u] = bitcast<u32>(drawn.rest.probability);
    output[4u * i + 2u] = drawn.rest.sign;
    output[4u * i + 3u] = bitcast<u32>(poisson_far_tail(mean, input[i].y));
}
