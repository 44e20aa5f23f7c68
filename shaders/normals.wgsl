// needs: materials, there
//
// Twin of `Material::normal` in transport/reflect.rs: the shading normal, interpolated from the
// normals at a triangle's corners, which the CPU computes (material/normals.rs).

// Shading normal, on the same side as the facet's normal.
fn smooth_normal(hit: Hit, about: Material, there: There, point: vec3f) -> vec3f {
    if about.normals == NOTHING || hit.triangle == NO_SURFACE {
        return hit.normal;
    }
    let weights = barycentric(there_corners(hit), there_point(there, point));
    let at = about.normals + about.normals_step * trees[hit.tree].shape
        + 9u * (hit.surface - about.first_triangle);
    let sum = weights.x * material_value3(at) + weights.y * material_value3(at + 3u)
        + weights.z * material_value3(at + 6u);
    let length2 = dot(sum, sum);
    if !(length2 > 1e-30) {
        return hit.normal;
    }
    let smoothed = turned_back(there.x, there.y, there.z, sum * inverseSqrt(length2));
    return select(smoothed, -smoothed, dot(smoothed, hit.normal) < 0.0);
}
