// needs: center
// Directions of the rays through pixel centres, by row-major pixel number.

// Number of pixels of the camera.
fn pixel_count() -> u32 {
    return u32(optics[0].camera.size.x) * u32(optics[0].camera.size.y);
}

// Direction, with z = 1, of the ray through the centre of pixel `i` in row-major order.
fn center_ray(i: u32) -> vec3f {
    let width = u32(optics[0].camera.size.x);
    return center(i % width, i / width);
}
