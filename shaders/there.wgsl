// needs: world, materials
//
// Transforms a hit into the frame in which its surface is stored: that of its triangle's hierarchy,
// or of the solid. Twin of World::at_rest, because barycentric weights and positions on solids are
// the same there as at rest.

// Rows of the pose from the rig's frame to that frame.
struct There {
    x: vec4f,
    y: vec4f,
    z: vec4f,
}

fn there_of(row: u32, hit: Hit) -> There {
    if hit.triangle != NO_SURFACE {
        let tree = trees[hit.tree];
        return There(tree.x, tree.y, tree.z);
    }
    let solid = solids[first_solid(row) + (hit.surface - world[0].triangles) / FACETS];
    return There(solid.x, solid.y, solid.z);
}

fn there_point(there: There, p: vec3f) -> vec3f {
    return posed(there.x, there.y, there.z, p);
}

fn there_direction(there: There, d: vec3f) -> vec3f {
    return turned(there.x, there.y, there.z, d);
}

// Corners of the hit triangle, as columns.
fn there_corners(hit: Hit) -> mat3x3f {
    let at = 3u * hit.stored;
    return mat3x3f(triangles[at].xyz, triangles[at + 1u].xyz, triangles[at + 2u].xyz);
}
