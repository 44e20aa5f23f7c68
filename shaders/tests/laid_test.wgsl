// needs: plan, laid
// Positions and patch sides on textures that are mapped onto shapes.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

fn input_vec3(at: u32) -> vec3f {
    return vec3f(bitcast<f32>(input[at]), bitcast<f32>(input[at + 1u]), bitcast<f32>(input[at + 2u]));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 13u * i >= arrayLength(&input) || 6u * i >= arrayLength(&output) {
        return;
    }
    let at = 13u * i;
    let own = Own(input_vec3(at + 1u), input_vec3(at + 4u), input_vec3(at + 7u), input_vec3(at + 10u));
    let laid = laid_over(input[at], own);
    let found = array<f32, 6>(
        laid.at.x, laid.at.y, laid.across.x, laid.across.y, laid.down.x, laid.down.y);
    for (var k = 0u; k < 6u; k++) {
        output[6u * i + k] = bitcast<u32>(found[k]);
    }
}
