// needs: plan, slide_axes, vignetting
// The light of the projector on a patch of surface that some ray has met. Twin of `bounce/patch.rs`.

// A place of a surface, and the sides of a patch about it.
struct Patch {
    at: vec3f,
    // Unit normal of the facet.
    normal: vec3f,
    across: vec3f,
    down: vec3f,
}

// A patch in the projector's field, shadows aside.
struct Shown {
    // Place on the slide.
    px: vec2f,
    // Sides of the patch there: their columns, and their rows.
    x: vec2f,
    y: vec2f,
    // Irradiance in W/m^2 under full white; 0 outside of the field and on the far side.
    irradiance: f32,
    // Of the angle that light comes in at.
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

// A box's width with half of a blur's variance: a box of width w has w^2 / 12, and a footprint is
// two boxes.
fn wide_under(side: f32, blur: f32) -> f32 {
    let wide = sqrt(side * side + 6.0 * blur * blur);
    return select(wide, -wide, side < 0.0);
}
