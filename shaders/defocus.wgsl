// needs: plan, optics, cast_types, soft
//
// Twin of exposure/defocus.rs: the width of the projector's defocus blur at each point.

// Upper limit of the blur in projector pixels: the blur of a point beside the pupil would be
// infinite.
const WIDEST_BLUR_PX: f32 = 1e6;

// Standard deviation of the blur along x of the pattern image, in projector pixels, at a point in
// the rig's frame.
fn blur_px(point: vec3f) -> f32 {
    let z = dot(optics[0].projector_z.xyz, point - projector_pupil());
    let nearest = select(max(z, 1e-6), min(z, -1e-6), z < 0.0);
    return min(optics[0].defocus_strength * abs(optics[0].defocus_sharp - 1.0 / nearest), WIDEST_BLUR_PX);
}

// The same along x and y, for the blur along x.
fn blur_along(blur: f32) -> vec2f {
    return blur * vec2f(1.0, optics[0].defocus_aspect);
}

// Dims points near the pattern image's edge: the part of a footprint that blur spreads beyond the
// edge carries no light. `point` is in the rig's frame.
fn dim_border(point: vec3f, shaded: ptr<function, Shaded>) {
    let sigma = blur_along(blur_px(point));
    if !((*shaded).reachable && sigma.x > 0.0) {
        return;
    }
    let size = optics[0].projector.size;
    let px = (*shaded).px;
    let footprint = (*shaded).footprint;
    let x = border_kept(px.x, size.x, footprint.xy, sigma.x);
    let y = border_kept(px.y, size.y, footprint.zw, sigma.y);
    (*shaded).projected *= x * y;
}

// Fraction of the light that remains along one axis of the pattern image.
fn border_kept(px: f32, size: f32, slope: vec2f, sigma: f32) -> f32 {
    let low = px + 0.5;
    let high = size - 0.5 - px;
    if min(low, high) >= 6.0 * sigma + abs(slope.x) + abs(slope.y) {
        return 1.0;
    }
    let soft = soft_new(slope, sigma);
    let lost = max(soft_beyond(soft, -low), 0.0) + max(soft_beyond(soft, -high), 0.0);
    return max(1.0 - lost, 0.0);
}
