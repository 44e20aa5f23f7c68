// needs: plan, interreflection_types
// Adds interreflected lamp light, which does not depend on the projected pattern, to the ambient
// maps. Twin of `add_lamps` in `interreflection/mod.rs`.

@group(0) @binding(2) var<storage, read_write> light: array<vec2f>;
@group(0) @binding(7) var<storage, read_write> flickering: array<f32>;
@group(0) @binding(95) var<storage, read> interreflection_params: InterreflectionParams;
@group(0) @binding(100) var<storage, read> interreflection_first: array<u32>;
@group(0) @binding(101) var<storage, read> interreflection_shares: array<vec4f>;
@group(0) @binding(102) var<storage, read> interreflection_lamps: array<vec2f>;

// Lamp light at a pixel and the amplitude of its flicker, in electrons per second.
fn lamps_at(pixel: u32) -> vec2f {
    let first = interreflection_first[pixel];
    let below = first + interreflection_params.columns;
    let by = interreflection_shares[pixel];
    var sum = vec2f(0.0);
    // A point with zero weight may not exist.
    if by.x > 0.0 {
        sum += by.x * interreflection_lamps[first];
    }
    if by.y > 0.0 {
        sum += by.y * interreflection_lamps[first + 1u];
    }
    if by.z > 0.0 {
        sum += by.z * interreflection_lamps[below];
    }
    if by.w > 0.0 {
        sum += by.w * interreflection_lamps[below + 1u];
    }
    return sum;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = linear(id, groups);
    if pixel >= interreflection_params.width * interreflection_params.height {
        return;
    }
    let added = lamps_at(pixel);
    light[pixel].y += added.x;
    if has_flicker {
        flickering[pixel] += added.y;
    }
}

@group(0) @binding(45) var<storage, read_write> mixed_heads: array<vec4u>;
@group(0) @binding(47) var<storage, read> mixed_count: array<u32>;

// The same for mixed pixels. Only the first head of each pixel is changed, because the sample
// groups of a pixel are summed.
@compute @workgroup_size(64)
fn mixed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= mixed_count[0] {
        return;
    }
    let head = mixed_heads[i];
    if head.y == 0u {
        return;
    }
    let added = lamps_at(head.x);
    mixed_heads[i].z = bitcast<u32>(bitcast<f32>(head.z) + added.x);
    if has_flicker {
        mixed_heads[i].w = bitcast<u32>(bitcast<f32>(head.w) + added.y);
    }
}
