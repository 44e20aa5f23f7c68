// needs: marks, cast_types, bvh, solid, optics
// The scene as seen by the rows of a frame: hierarchies of triangles, each in its own frame, and
// solids. Twin of `world.rs`, `tree.rs` and `worlds.rs` in `scene`; `gpu/scene.rs` fills the
// buffers.

struct World {
    // Number of hierarchies and of solids at one instant.
    trees: u32,
    solids: u32,
    // Triangles, which are numbered before the facets of solids.
    triangles: u32,
    // 1 if each row has its own hierarchies and solids, else 0.
    by_row: u32,
}

// Hierarchies of each row, row by row, or one set for all rows.
@group(0) @binding(15) var<storage, read> trees: array<Tree>;
// Solids likewise.
@group(0) @binding(16) var<storage, read> solids: array<Solid>;
@group(0) @binding(17) var<storage, read> world: array<World, 1>;
// Object of each triangle.
@group(0) @binding(18) var<storage, read> owner: array<u32>;

// Relative tolerance of shadow rays. An intersection within this fraction of the ray before the
// surface point is taken as the point's own surface and casts no shadow. Rays that leave a point
// start at this fraction of its distance from the rig: 10 um at 1 m, far above the error of f32.
const OFF_POINT: f32 = 1e-5;
// Maximum number of facets of a solid.
const FACETS: u32 = 8u;

fn posed(x: vec4f, y: vec4f, z: vec4f, p: vec3f) -> vec3f {
    return vec3f(dot(x.xyz, p) + x.w, dot(y.xyz, p) + y.w, dot(z.xyz, p) + z.w);
}

fn turned(x: vec4f, y: vec4f, z: vec4f, d: vec3f) -> vec3f {
    return vec3f(dot(x.xyz, d), dot(y.xyz, d), dot(z.xyz, d));
}

// Inverse rotation.
fn turned_back(x: vec4f, y: vec4f, z: vec4f, d: vec3f) -> vec3f {
    return x.xyz * d.x + y.xyz * d.y + z.xyz * d.z;
}

fn is_triangle(surface: u32) -> bool {
    return surface < world[0].triangles;
}

// The object that a surface belongs to.
fn object_of(surface: u32) -> u32 {
    if is_triangle(surface) {
        return owner[surface];
    }
    return solids[(surface - world[0].triangles) / FACETS].object;
}

// Index of the first of a row's hierarchies.
fn first_tree(row: u32) -> u32 {
    return row * world[0].by_row * world[0].trees;
}

fn first_solid(row: u32) -> u32 {
    return row * world[0].by_row * world[0].solids;
}

fn towards_ray(normal: vec3f, direction: vec3f) -> vec3f {
    return select(normal, -normal, dot(normal, direction) > 0.0);
}

// The hit of a ray on a stored triangle of a hierarchy, refined from the approximate parameter
// found by the traversal.
fn solved(at: u32, origin: vec3f, direction: vec3f, found: Found) -> Hit {
    let tree = trees[at];
    let there = posed(tree.x, tree.y, tree.z, origin);
    let along = turned(tree.x, tree.y, tree.z, direction);
    let a = triangles[3u * found.triangle];
    let b = triangles[3u * found.triangle + 1u];
    let c = triangles[3u * found.triangle + 2u];
    let flat = vec3f(a.w, b.w, c.w);
    let t = solve(a.xyz - there, b.xyz - there, c.xyz - there, flat, along, found.t);
    var normal = towards_ray(turned_back(tree.x, tree.y, tree.z, flat), direction);
    // A triangle without area, which closes a gap between its neighbours, is treated as facing the
    // ray.
    if dot(flat, flat) < 0.5 {
        normal = -normalize(direction);
    }
    let surface = tree.first + triangle_ids[found.triangle];
    return Hit(t, surface, normal, surface, found.triangle, at);
}

// Nearest surface along a camera ray.
fn nearest(ray: Ray) -> Hit {
    var hit = no_hit();
    let first = first_tree(ray.row);
    var found = Found(NEVER, NO_SURFACE);
    var at = first;
    for (var i = 0u; i < world[0].trees; i++) {
        let tree = trees[first + i];
        let there = posed(tree.x, tree.y, tree.z, ray.origin);
        let along = turned(tree.x, tree.y, tree.z, ray.direction);
        let nearer = walk(tree, there, along, 0.0, found.t, NO_SURFACE, false);
        if nearer.triangle != NO_SURFACE {
            found = nearer;
            at = first + i;
        }
    }
    if found.triangle != NO_SURFACE {
        hit = solved(at, ray.origin, ray.direction, found);
    }
    let base = first_solid(ray.row);
    for (var i = 0u; i < world[0].solids; i++) {
        let solid = solids[base + i];
        let there = posed(solid.x, solid.y, solid.z, ray.origin);
        let along = turned(solid.x, solid.y, solid.z, ray.direction);
        let met = meet_solid(solid, there, along, 0.0);
        if met.t < hit.t {
            let normal = turned_back(solid.x, solid.y, solid.z, met.normal);
            let surface = world[0].triangles + i * FACETS + met.facet;
            hit = Hit(met.t, surface, towards_ray(normal, ray.direction), NO_SURFACE, NO_SURFACE, 0u);
        }
    }
    return hit;
}

// Whether a ray meets, between two parameters, any surface other than `surface` itself or the
// convex solid that it belongs to.
fn meets_any(row: u32, origin: vec3f, direction: vec3f, start: f32, end: f32, surface: u32) -> bool {
    let first = first_tree(row);
    for (var i = 0u; i < world[0].trees; i++) {
        let tree = trees[first + i];
        let there = posed(tree.x, tree.y, tree.z, origin);
        let along = turned(tree.x, tree.y, tree.z, direction);
        // For a surface of another hierarchy, the difference matches no triangle of this one.
        let found = walk(tree, there, along, start, end, surface - tree.first, true);
        if found.triangle != NO_SURFACE {
            return true;
        }
    }
    let base = first_solid(row);
    let object = object_of(surface);
    for (var i = 0u; i < world[0].solids; i++) {
        let solid = solids[base + i];
        // Seen from outside, the only self-shadowing of a convex solid is by faces that face away.
        if solid.object == object && solid.around_camera == 0u {
            continue;
        }
        let there = posed(solid.x, solid.y, solid.z, origin);
        let along = turned(solid.x, solid.y, solid.z, direction);
        if meet_solid(solid, there, along, start).t < end {
            return true;
        }
    }
    return false;
}

// Whether an object blocks the way between a light's pupil and a point of a surface, in the rig's
// frame.
fn blocked_from(row: u32, pupil: vec3f, point: vec3f, surface: u32) -> bool {
    return meets_any(row, pupil, point - pupil, 0.0, 1.0 - OFF_POINT, surface);
}

// The same for the projector's pupil.
fn blocked(row: u32, point: vec3f, surface: u32) -> bool {
    return blocked_from(row, projector_pupil(), point, surface);
}

// The same for a distant light in the direction of a unit vector.
fn blocked_along(row: u32, towards: vec3f, point: vec3f, surface: u32) -> bool {
    return meets_any(row, point, towards, length(point) * OFF_POINT, NEVER, surface);
}
