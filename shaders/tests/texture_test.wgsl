// needs: plan, texture
// Means of textures over footprints.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

fn input_vec2(at: u32) -> vec2f {
    return vec2f(bitcast<f32>(input[at]), bitcast<f32>(input[at + 1u]));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 10u * i >= arrayLength(&input) || i >= arrayLength(&output) {
        return;
    }
    let at = 10u * i;
    let image = Picture(input[at], input[at + 1u], input[at + 2u], bitcast<f32>(input[at + 3u]));
    let mean = texture_average(image, input_vec2(at + 4u), input_vec2(at + 6u), input_vec2(at + 8u));
    output[i] = bitcast<u32>(mean);
}
