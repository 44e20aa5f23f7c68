// needs: plan, optics, cast_types
//
// Twin of exposure/vignetting.rs: decrease of light from a lens's axis outwards.

// Upper limit of the squared tangent: no pixel lies beyond it, so the polynomial need not be right
// there.
const FALLOFF_END: f32 = 1e6;

// Vignetting factor at an ideal image point, whose length is the tangent of the angle to the axis.
fn falloff_at(falloff: Falloff, ideal: vec2f) -> f32 {
    let tangent2 = min(dot(ideal, ideal), FALLOFF_END);
    let a = falloff.terms;
    let s = tangent2 * a.w * a.w;
    var factor = max(1.0 + s * (a.x + s * (a.y + s * a.z)), 0.0);
    if falloff.natural != 0u {
        let cosine2 = 1.0 / (1.0 + tangent2);
        factor *= select(sqrt(cosine2), cosine2 * cosine2, falloff.cosines == 4u);
    }
    return factor;
}

// Applies the camera's vignetting to all light; `direction` has z = 1.
fn dim_seen(direction: vec3f, shaded: ptr<function, Shaded>) {
    let factor = falloff_at(optics[0].seen, direction.xy);
    (*shaded).projected *= factor;
    (*shaded).ambient *= factor;
    (*shaded).flickering *= factor;
    (*shaded).evenly *= factor;
}

// Applies the projector's vignetting at an ideal point of its image.
fn dim_projected(ideal: vec2f, shaded: ptr<function, Shaded>) {
    (*shaded).projected *= falloff_at(optics[0].shown, ideal);
}
