// needs: plan, pattern_image_axes, vignetting
// Projector light on a patch of the surface that a ray has hit. Twin of `interreflection/patch.rs`.

// A point of a surface and the sides of a patch around it.
struct Patch {
    at: vec3f,
    // Unit normal of the facet.
    normal: vec3f,
    across: vec3f,
    down: vec3f,
}

// A patch as seen by the projector, ignoring shadows.
struct Shown {
    // Position on the pattern image.
    px: vec2f,
    // Extent of the patch's two sides on the pattern image: along columns (x) and rows (y).
    x: vec2f,
    y: vec2f,
    // Irradiance in W/m^2 under full white; 0 outside of the projector's field of view and for
    // surfaces that face away.
    irradiance: f32,
    // Cosine of the angle of incidence.
    cos: f32,
}

fn shown(found: Patch) -> Shown {
    let none = Shown(vec2f(0.0), vec2f(0.0), vec2f(0.0), 0.0, 0.0);
    let axes = projector_axes();
    let way = found.at - projector_pupil();
    let local = way * axes;
    let distance2 = dot(way, way);
    let cos = -dot(found.normal, way) / sqrt(max(distance2, 1e-30));
    if !(local.z > 0.0 && cos > 0.0) {
        return none;
    }
    let lens = optics[0].projector;
    let ideal = local.xy / local.z;
    var px = lens.focal * ideal + lens.principal;
    var bent = mat2x2f(1.0, 0.0, 0.0, 1.0);
    var folded = false;
    if has_projector_distortion {
        let place = lens_place(lens, ideal);
        px = place.px;
        folded = place.folded;
        bent = lens_jacobian(lens, ideal);
    }
    if folded || !lens_contains(lens, px) {
        return none;
    }
    var irradiance = optics[0].projected / optics[0].electrons_per_irradiance * cos / distance2;
    if has_projector_vignetting {
        irradiance *= falloff_at(optics[0].shown, ideal);
    }
    let a = found.across * axes;
    let b = found.down * axes;
    let across = lens.focal * (bent * ((a.xy - ideal * a.z) / local.z));
    let down = lens.focal * (bent * ((b.xy - ideal * b.z) / local.z));
    return Shown(px, vec2f(across.x, down.x), vec2f(across.y, down.y), irradiance, cos);
}

// Width of a box with half of the blur's variance added: a box of width w has variance w^2 / 12,
// and a footprint consists of two boxes.
fn wide_under(side: f32, blur: f32) -> f32 {
    let wide = sqrt(side * side + 6.0 * blur * blur);
    return select(wide, -wide, side < 0.0);
}
