// needs: plan, optics
// Converts pixels to rays and back. Output for each pixel: the camera's ray, the camera's pixel of
// that ray and the Jacobian there; the projector's pixel of the ray at twice the distance from the
// axis; and for projector and camera a flag that is set beyond the fold of the distortion.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 2u * i + 1u >= arrayLength(&input) {
        return;
    }
    let px = vec2f(bitcast<f32>(input[2u * i]), bitcast<f32>(input[2u * i + 1u]));
    let ray = lens_ray(optics[0].camera, px);
    let back = lens_place(optics[0].camera, ray);
    let jacobian = lens_jacobian(optics[0].camera, ray);
    // Also tests rays farther off axis than any pixel.
    let shown = lens_place(optics[0].projector, ray * 2.0);
    output[12u * i] = bitcast<u32>(ray.x);
    output[12u * i + 1u] = bitcast<u32>(ray.y);
    output[12u * i + 2u] = bitcast<u32>(back.px.x);
    output[12u * i + 3u] = bitcast<u32>(back.px.y);
    output[12u * i + 4u] = bitcast<u32>(jacobian[0].x);
    output[12u * i + 5u] = bitcast<u32>(jacobian[0].y);
    output[12u * i + 6u] = bitcast<u32>(jacobian[1].x);
    output[12u * i + 7u] = bitcast<u32>(jacobian[1].y);
    output[12u * i + 8u] = bitcast<u32>(shown.px.x);
    output[12u * i + 9u] = bitcast<u32>(shown.px.y);
    output[12u * i + 10u] = select(0u, 1u, shown.folded);
    output[12u * i + 11u] = select(0u, 1u, back.folded);
}
