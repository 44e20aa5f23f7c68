// needs: plan, optics
// Directions of camera rays that do not pass through pixel centres. Twin of `Rays` in
// `transport/rays.rs`.

// Direction, with z = 1, of the ray through any point of the image.
fn camera_ray(px: vec2f) -> vec3f {
    let lens = optics[0].camera;
    if has_camera_distortion {
        return vec3f(lens_ray(lens, px), 1.0);
    }
    return vec3f((px - lens.principal) * lens.scale, 1.0);
}

// Converts a step of a direction with z = 1 into pixels: the inverse of `ray_slopes`.
fn px_step(direction: vec3f, step: vec2f) -> vec2f {
    let lens = optics[0].camera;
    if has_camera_distortion {
        return lens.focal * (lens_jacobian(lens, direction.xy) * step);
    }
    return lens.focal * step;
}
