// needs: plan, aperture
// Widens the footprints of all pixels by the depth-of-field blur at the surfaces that their centres
// see: the last pass for a camera with depth of field. Twin of `Aperture::widen`.

@group(0) @binding(1) var<storage, read_write> slopes: array<vec4f>;
@group(0) @binding(3) var<storage, read> seen: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= sampling.size.x * sampling.size.y {
        return;
    }
    let radius = disc_px(seen[i].w);
    let slope = slopes[i];
    slopes[i] = vec4f(widened(slope.xy, radius), widened(slope.zw, radius));
}
