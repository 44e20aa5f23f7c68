// needs: plan, solid
// Rays against solids in the solids' frames. Input: origin, direction, start, kind and size.
// Output: parameter, facet and normal.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

fn given(i: u32) -> f32 {
    return bitcast<f32>(input[i]);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    let at = 12u * i;
    if at + 11u >= arrayLength(&input) {
        return;
    }
    var solid: Solid;
    solid.kind = input[at + 7u];
    solid.size = vec4f(given(at + 8u), given(at + 9u), given(at + 10u), given(at + 11u));
    let origin = vec3f(given(at), given(at + 1u), given(at + 2u));
    let direction = vec3f(given(at + 3u), given(at + 4u), given(at + 5u));
    let hit = meet_solid(solid, origin, direction, given(at + 6u));
    output[5u * i] = bitcast<u32>(hit.t);
    output[5u * i + 1u] = hit.facet;
    output[5u * i + 2u] = bitcast<u32>(hit.normal.x);
    output[5u * i + 3u] = bitcast<u32>(hit.normal.y);
    output[5u * i + 4u] = bitcast<u32>(hit.normal.z);
}
