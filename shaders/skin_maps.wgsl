// needs: plan, maps_in, world, center_ray, skin_scatter
// Subsurface scattering at all pixels' centres: where their light enters the skin and how far it
// spreads. Twin of `SkinMaps::new` in `transport/skin.rs`.

@group(0) @binding(90) var<storage, read_write> under_skin: array<UnderSkin>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= pixel_count() {
        return;
    }
    var found = not_skin(place[i]);
    if (marks[i] & LIT) != 0u {
        let here = seen[i];
        found = scatter(place[i], object_of(surface[i]), center_ray(i) * here.w, here.xyz);
    }
    under_skin[i] = found;
}
