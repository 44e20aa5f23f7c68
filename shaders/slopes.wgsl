// needs: plan, optics
// Derivatives of the camera's rays. Twin of `Optics::ray_slopes`.

// Derivatives of a ray (z = 1) by the camera's pixel: column j holds those by coordinate j.
fn ray_slopes(direction: vec3f) -> mat2x2f {
    let scale = optics[0].camera.scale;
    if has_camera_distortion {
        let m = lens_inverse(lens_jacobian(optics[0].camera, direction.xy));
        return mat2x2f(m[0] * scale.x, m[1] * scale.y);
    }
    return mat2x2f(scale.x, 0.0, 0.0, scale.y);
}
