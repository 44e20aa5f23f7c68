// needs: plan, ggx
// The specular lobe and diffuse base of materials, direction by direction: reflectance for light
// from one direction, and for uniform light.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

fn input_vec3(at: u32) -> vec3f {
    return vec3f(bitcast<f32>(input[at]), bitcast<f32>(input[at + 1u]), bitcast<f32>(input[at + 2u]));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 11u * i >= arrayLength(&input) || 2u * i >= arrayLength(&output) {
        return;
    }
    let at = 11u * i;
    let material = input[at];
    let albedo = bitcast<f32>(input[at + 1u]);
    let normal = input_vec3(at + 2u);
    let light = input_vec3(at + 5u);
    let view = input_vec3(at + 8u);
    output[2u * i] = bitcast<u32>(ggx_reflectance(material, albedo, normal, light, view));
    output[2u * i + 1u] = bitcast<u32>(ggx_under_even_light(material, albedo, dot(normal, view)));
}
