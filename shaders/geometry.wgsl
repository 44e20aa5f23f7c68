// needs: plan, maps_out, cast, center, defocus
// The geometry pass: for each pixel, the surface that it sees, the point on the pattern image that
// lights it, and how much of that light arrives. Twin of `transport/geometry.rs`. One workgroup per
// tile of 8 x 8 pixels, whose rays meet the same nodes.

const SIDE: u32 = 8u;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let number = linear(id, groups);
    let width = u32(optics[0].camera.size.x);
    let height = u32(optics[0].camera.size.y);
    let across = (width + SIDE - 1u) / SIDE;
    let tile = number / GROUP;
    let column = (tile % across) * SIDE + number % SIDE;
    let row = (tile / across) * SIDE + (number % GROUP) / SIDE;
    if column >= width || row >= height {
        return;
    }
    let pixel = row * width + column;
    let end = cast_ray(Ray(vec3f(0.0), 1.0, center(column, row), row));
    let is_hit = end.hit.surface != NO_SURFACE;
    surface[pixel] = end.hit.surface;
    place[pixel] = end.shaded.px;
    light[pixel] = vec2f(select(0.0, end.shaded.projected, end.lit), end.shaded.ambient);
    seen[pixel] = vec4f(end.hit.normal, end.shaded.point.z);
    marks[pixel] = select(0u, SEEN, is_hit) | select(0u, LIT, end.lit) | select(0u, SQUARE, end.shaded.square);
    if has_footprint_x || has_footprint_y {
        slopes[pixel] = end.shaded.footprint;
    }
    if has_projector_defocus {
        var sigma = 0.0;
        if is_hit {
            sigma = blur_px(end.shaded.point);
        }
        blur[pixel] = sigma;
    }
    if has_flicker {
        flickering[pixel] = end.shaded.flickering;
    }
    if has_lights {
        lamp_bits[pixel] = end.shaded.lamps;
    }
    if has_interreflection {
        evenly[pixel] = end.shaded.evenly;
    }
}
