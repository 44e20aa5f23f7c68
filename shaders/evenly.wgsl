// needs: look, patch
// What a surface throws back of a light, counted as if it went evenly in all directions. Twin of
// `look/evenly.rs`.

// The material of a patch.
struct Evenly {
    albedo: f32,
    material: u32,
}

fn evenly_of(found: Patch, object: u32) -> Evenly {
    return Evenly(first_albedo(object), 0u);
}

// Share of light from a direction at this cosine to the normal that is thrown back: that of the body
// and that of the lobe together, so that no energy is lost or won.
fn evenly_share(look: Evenly, cos: f32) -> f32 {
    return look.albedo;
}
