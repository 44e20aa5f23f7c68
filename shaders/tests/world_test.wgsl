// needs: plan, world, leaving
// Input: a row, an origin and a direction. Output: parameter and surface of the nearest hit of that
// camera ray; then, from that hit, whether a lamp 100 mm above the camera is hidden, whether a
// distant one is, and the nearest surface along the mirrored ray.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

fn given(i: u32) -> vec3f {
    return vec3f(bitcast<f32>(input[i]), bitcast<f32>(input[i + 1u]), bitcast<f32>(input[i + 2u]));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 7u * i + 6u >= arrayLength(&input) {
        return;
    }
    let row = input[7u * i];
    let origin = given(7u * i + 1u);
    let direction = given(7u * i + 4u);
    let hit = nearest(Ray(origin, 1.0, direction, row));
    output[6u * i] = bitcast<u32>(hit.t);
    output[6u * i + 1u] = hit.surface;
    if hit.surface == NO_SURFACE {
        return;
    }
    let point = origin + direction * hit.t;
    let towards = normalize(vec3f(-0.6, -0.3, -0.7));
    output[6u * i + 2u] = select(0u, 1u, blocked_from(row, vec3f(0.0, -100.0, 0.0), point, hit.surface));
    output[6u * i + 3u] = select(0u, 1u, blocked_along(row, towards, point, hit.surface));
    let mirrored = leaving(row, point, hit.surface, normalize(reflect(direction, hit.normal)));
    output[6u * i + 4u] = bitcast<u32>(mirrored.t);
    output[6u * i + 5u] = mirrored.surface;
}
