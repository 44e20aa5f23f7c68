// needs: center
// Directions of the rays through pixels' centres, by the pixels' numbers.

// How many pixels the camera has.
fn pixel_count() -> u32 {
    return u32(optics[0].camera.size.x) * u32(optics[0].camera.size.y);
}

// With z = 1, of a pixel by its row-major number.
fn center_ray(i: u32) -> vec3f {
    let width = u32(optics[0].camera.size.x);
    return center(i % width, i / width);
}
