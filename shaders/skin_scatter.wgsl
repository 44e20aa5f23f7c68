// needs: plan, pattern_image_axes, skin_types
// Subsurface scattering at one point of skin, expressed on the pattern image. Twin of `Skins::at`
// in `skin/mod.rs`.

// For each object, the index of its tissue, or `NO_TISSUE`, and the bits of the distance in
// millimetres at which light emerges that enters along the surface (grazing incidence).
@group(0) @binding(92) var<storage, read> skin_of: array<vec2u>;

// The value for a point at a position of the pattern image that is not lit skin.
fn not_skin(place: vec2f) -> UnderSkin {
    return UnderSkin(place, vec2f(0.0), NO_TISSUE, 0u);
}

// The value for a lit point of an object, with its unit normal, both in the rig's frame.
fn scatter(place: vec2f, object: u32, at: vec3f, normal: vec3f) -> UnderSkin {
    let skin = skin_of[object];
    if skin.x == NO_TISSUE {
        return not_skin(place);
    }
    // Component along the surface; its length is the sine of the angle of incidence.
    let way = normalize(at - projector_pupil());
    let along = way - normal * dot(normal, way);
    // Light that emerges here entered this far back along its direction.
    let shift = along * -bitcast<f32>(skin.y);
    let gradients = pattern_image_gradients(at);
    let x = gradients[0];
    let y = gradients[1];
    let px_per_mm = vec2f(
        length(x - normal * dot(normal, x)),
        length(y - normal * dot(normal, y)),
    );
    let origin = place + vec2f(dot(x, shift), dot(y, shift));
    return UnderSkin(origin, px_per_mm, skin.x, 0u);
}

// Gradients of the projector's column and row by a point in the rig's frame, in 1/mm.
fn pattern_image_gradients(at: vec3f) -> mat2x3f {
    let axes = projector_axes();
    let local = (at - projector_pupil()) * axes;
    let ideal = local.xy / local.z;
    let by_x = vec3f(1.0, 0.0, -ideal.x) / local.z;
    let by_y = vec3f(0.0, 1.0, -ideal.y) / local.z;
    var x = by_x;
    var y = by_y;
    if has_projector_distortion {
        let bent = lens_jacobian(optics[0].projector, ideal);
        x = by_x * bent[0].x + by_y * bent[1].x;
        y = by_x * bent[0].y + by_y * bent[1].y;
    }
    let focal = optics[0].projector.focal;
    return mat2x3f(axes * x * focal.x, axes * y * focal.y);
}
