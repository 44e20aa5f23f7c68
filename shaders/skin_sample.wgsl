// needs: world, skin_scatter
// Subsurface scattering at a sample of a mixed pixel. Twin of `into_sample` in
// `transport/skin.rs`.

// For each sample of the mixed pixels, sixteen per head.
@group(0) @binding(91) var<storage, read_write> mixed_skin: array<UnderSkin>;

// Records the subsurface scattering of a sample at its surface point in the rig's frame. `number`
// is the index among the samples of all mixed pixels. Returns the position on the pattern image
// that the light comes from.
fn into_sample(
    number: u32, is_lit: bool, place: vec2f, surface: u32, at: vec3f, normal: vec3f,
) -> vec2f {
    var found = not_skin(place);
    if is_lit {
        found = scatter(place, object_of(surface), at, normal);
    }
    mixed_skin[number] = found;
    return found.origin;
}
