// needs: looks, there
//
// Twin of look/normals.rs as far as a ray needs it: the smooth normal, which highlights follow, of
// those at the corners of a triangle, which are made on the CPU.

// The normal that highlights follow, on the side of the facet's.
fn smooth_normal(hit: Hit, about: Look, there: There, point: vec3f) -> vec3f {
    if about.normals == NOTHING || hit.triangle == NO_SURFACE {
        return hit.normal;
    }
    let weights = barycentric(there_corners(hit), there_point(there, point));
    let at = about.normals + about.normals_step * trees[hit.tree].shape
        + 9u * (hit.surface - about.first_triangle);
    let sum = weights.x * look_value3(at) + weights.y * look_value3(at + 3u)
        + weights.z * look_value3(at + 6u);
    let length2 = dot(sum, sum);
    if !(length2 > 1e-30) {
        return hit.normal;
    }
    let smoothed = turned_back(there.x, there.y, there.z, sum * inverseSqrt(length2));
    return select(smoothed, -smoothed, dot(smoothed, hit.normal) < 0.0);
}
