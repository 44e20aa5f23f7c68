// needs: world
// Nearest surface along rays that leave a point of a surface in any direction. Twin of
// `raycast/leaving.rs` and `World::leaving` in `scene/world.rs`.

// Triangles extend beyond their edges by this fraction of their sides.
const OVERLAP: f32 = 1e-6;
// Relative rounding error by which an origin may miss the plane of the triangle that it lies in.
const ROUNDING: f32 = 4.8e-7;

// The test of Moller and Trumbore ("Fast, Minimum Storage Ray/Triangle Intersection", Journal of
// Graphics Tools 2(1), 1997); returns the ray parameter, or `NEVER`. `farthest` is the largest
// coordinate of the origin, in this frame or in the rig's frame, where it was rounded.
fn meet_leaving(a: vec3f, b: vec3f, c: vec3f, origin: vec3f, d: vec3f, farthest: f32) -> f32 {
    let e1 = b - a;
    let e2 = c - a;
    let s = origin - a;
    let n = cross(e1, e2);
    let height = dot(s, n);
    let far = abs(s);
    let size = max(max(far.x, far.y), far.z) + farthest;
    let facing = dot(d, n);
    if abs(height) <= ROUNDING * size * length(n) || facing == 0.0 {
        return NEVER;
    }
    let one = -1.0 / facing;
    let u = dot(d, cross(e2, s)) * one;
    let v = dot(d, cross(s, e1)) * one;
    let t = height * one;
    let inside = u >= -OVERLAP && v >= -OVERLAP && u + v <= 1.0 + OVERLAP && t > 0.0;
    return select(NEVER, t, inside);
}

// Nearest intersection with a hierarchy's triangles before `end`, in the format of `walk`.
fn walk_leaving(tree: Tree, origin: vec3f, direction: vec3f, end: f32, farthest: f32) -> Found {
    var found = Found(end, NO_SURFACE);
    let inverse = inverse_of(direction);
    var stack: array<u32, LEVELS>;
    var entries: array<f32, LEVELS>;
    var height = 0u;
    var node = entry(tree.nodes, origin, inverse, end);
    if node.t == NEVER {
        return found;
    }
    for (var round = 0u; round < 2u * tree.count; round++) {
        var down = false;
        if node.count > 0u {
            let stop = tree.triangles + node.first + node.count;
            for (var i = tree.triangles + node.first; i < stop; i++) {
                let a = triangles[3u * i].xyz;
                let b = triangles[3u * i + 1u].xyz;
                let c = triangles[3u * i + 2u].xyz;
                let t = meet_leaving(a, b, c, origin, direction, farthest);
                if t < found.t {
                    found = Found(t, i);
                }
            }
        } else {
            let child = tree.nodes + node.first;
            let left = entry(child, origin, inverse, found.t);
            let right = entry(child + 1u, origin, inverse, found.t);
            let swap = right.t < left.t;
            let later = max(left.t, right.t);
            if later < NEVER && height < LEVELS {
                stack[height] = select(child + 1u, child, swap);
                entries[height] = later;
                height++;
            }
            down = min(left.t, right.t) < NEVER;
            node.first = select(left.first, right.first, swap);
            node.count = select(left.count, right.count, swap);
        }
        while !down {
            if height == 0u {
                return found;
            }
            height--;
            if entries[height] <= found.t {
                down = true;
                node.first = nodes[2u * stack[height]].w;
                node.count = nodes[2u * stack[height] + 1u].w;
            }
        }
    }
    return found;
}

// Nearest surface along a ray from a point of the surface `own`, in the rig's frame; the direction
// has unit length and points to the side of the surface that the camera sees.
fn leaving(row: u32, point: vec3f, own: u32, direction: vec3f) -> Hit {
    var hit = no_hit();
    let first = first_tree(row);
    for (var i = 0u; i < world[0].trees; i++) {
        let tree = trees[first + i];
        let there = posed(tree.x, tree.y, tree.z, point);
        let along = turned(tree.x, tree.y, tree.z, direction);
        let far = max(abs(point), abs(there));
        let found = walk_leaving(tree, there, along, hit.t, max(max(far.x, far.y), far.z));
        if found.triangle != NO_SURFACE {
            let a = triangles[3u * found.triangle].w;
            let b = triangles[3u * found.triangle + 1u].w;
            let c = triangles[3u * found.triangle + 2u].w;
            let normal = turned_back(tree.x, tree.y, tree.z, vec3f(a, b, c));
            let surface = tree.first + triangle_ids[found.triangle];
            let side = towards_ray(normal, direction);
            hit = Hit(found.t, surface, side, surface, found.triangle, first + i);
        }
    }
    let base = first_solid(row);
    let object = object_of(own);
    for (var i = 0u; i < world[0].solids; i++) {
        let solid = solids[base + i];
        // Rays that leave the outside of a convex solid cannot hit it again.
        if solid.object == object && solid.around_camera == 0u {
            continue;
        }
        let there = posed(solid.x, solid.y, solid.z, point);
        let along = turned(solid.x, solid.y, solid.z, direction);
        let met = meet_solid(solid, there, along, length(point) * OFF_POINT);
        if met.t < hit.t {
            let normal = turned_back(solid.x, solid.y, solid.z, met.normal);
            let surface = world[0].triangles + i * FACETS + met.facet;
            hit = Hit(met.t, surface, towards_ray(normal, direction), NO_SURFACE, NO_SURFACE, 0u);
        }
    }
    return hit;
}
