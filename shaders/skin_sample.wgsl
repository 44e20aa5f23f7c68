// needs: world, skin_scatter
// The skin under a sample of a mixed pixel. Twin of `into_sample` in `skin/maps.rs`.

// Of each sample of the mixed pixels, sixteen a head.
@group(0) @binding(91) var<storage, read_write> mixed_skin: array<UnderSkin>;

// Follows the light of a sample, `number` among those of all mixed pixels, to its point of a surface
// in the rig's frame; gives the place on the slide that it comes from.
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
