// needs: marks, cast_types, bvh, solid, optics
// The scene as the rows of a frame see it: hierarchies of triangles, each in its own frame, and
// solids. Twin of `world.rs`, `tree.rs` and `worlds.rs`; the buffers are made by `gpu/scene.rs`.

struct World {
    // Hierarchies and solids, of one instant.
    trees: u32,
    solids: u32,
    // Triangles, which are numbered before the facets of solids.
    triangles: u32,
    // 1 where each row has hierarchies and solids of its own, else 0.
    by_row: u32,
}

// Hierarchies of each row, row by row, or of all rows.
@group(0) @binding(15) var<storage, read> trees: array<Tree>;
// Solids likewise.
@group(0) @binding(16) var<storage, read> solids: array<Solid>;
@group(0) @binding(17) var<storage, read> world: array<World, 1>;
// Object of each triangle.
@group(0) @binding(18) var<storage, read> owner: array<u32>;

// What stands this fraction before a point's end of a shadow ray touches the point rather than shades
// it, and where rays that leave a point start, relative to its distance from the rig: 10 um at 1 m, far above
// the error of f32.
const OFF_POINT: f32 = 1e-5;
// Facets that a solid may have.
const FACETS: u32 = 8u;

fn posed(x: vec4f, y: vec4f, z: vec4f, p: vec3f) -> vec3f {
    return vec3f(dot(x.xyz, p) + x.w, dot(y.xyz, p) + y.w, dot(z.xyz, p) + z.w);
}

fn turned(x: vec4f, y: vec4f, z: vec4f, d: vec3f) -> vec3f {
    return vec3f(dot(x.xyz, d), dot(y.xyz, d), dot(z.xyz, d));
}

// The other way round.
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

// Place of the first of a row's hierarchies.
fn first_tree(row: u32) -> u32 {
    return row * world[0].by_row * world[0].trees;
}

fn first_solid(row: u32) -> u32 {
    return row * world[0].by_row * world[0].solids;
}

fn towards_ray(normal: vec3f, direction: vec3f) -> vec3f {
    return select(normal, -normal, dot(normal, direction) > 0.0);
}

// The hit of a ray on a stored triangle of a hierarchy, of which the walk has said where about.
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
    // A triangle without area, which closes a gap between its neighbours, counts as facing the ray.
    if dot(flat, flat) < 0.5 {
        normal = -normalize(direction);
    }
    let surface = tree.first + triangle_ids[found.triangle];
    return Hit(t, surface, normal, surface, found.triangle, at);
}

// The nearest surface along a ray of the camera.
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

// Whether something other than `surface` itself, or than the convex solid that it is of, is met by
// a ray between two parameters.
fn meets_any(row: u32, origin: vec3f, direction: vec3f, start: f32, end: f32, surface: u32) -> bool {
    let first = first_tree(row);
    for (var i = 0u; i < world[0].trees; i++) {
        let tree = trees[first + i];
        let there = posed(tree.x, tree.y, tree.z, origin);
        let along = turned(tree.x, tree.y, tree.z, direction);
        // A number of another hierarchy's, less the first, is none of this one's.
        let found = walk(tree, there, along, start, end, surface - tree.first, true);
        if found.triangle != NO_SURFACE {
            return true;
        }
    }
    let base = first_solid(row);
    let object = object_of(surface);
    for (var i = 0u; i < world[0].solids; i++) {
        let solid = solids[base + i];
        // Seen from outside, a convex solid shades itself only by facing away.
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

// Whether something stands between a light's pupil and a point of a surface, in the rig's frame.
fn blocked_from(row: u32, pupil: vec3f, point: vec3f, surface: u32) -> bool {
    return meets_any(row, pupil, point - pupil, 0.0, 1.0 - OFF_POINT, surface);
}

// The same of the projector's pupil.
fn blocked(row: u32, point: vec3f, surface: u32) -> bool {
    return blocked_from(row, projector_pupil(), point, surface);
}

// The same of a light far away, towards which a unit vector points.
fn blocked_along(row: u32, towards: vec3f, point: vec3f, surface: u32) -> bool {
    return meets_any(row, point, towards, length(point) * OFF_POINT, NEVER, surface);
}
