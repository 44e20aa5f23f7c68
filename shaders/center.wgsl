// needs: plan, optics
// Directions of the camera's rays through pixel centres. Twin of `Rays::center` in
// `transport/rays.rs`.

// Ideal (undistorted) image points of all pixels; used only if the lens is distorted.
@group(0) @binding(11) var<storage, read> rays: array<vec2f>;

// Direction, with z = 1, of the ray through a pixel's centre.
fn center(column: u32, row: u32) -> vec3f {
    if has_camera_distortion {
        return vec3f(rays[row * u32(optics[0].camera.size.x) + column], 1.0);
    }
    let px = vec2f(f32(column), f32(row));
    return vec3f((px - optics[0].camera.principal) * optics[0].camera.scale, 1.0);
}
