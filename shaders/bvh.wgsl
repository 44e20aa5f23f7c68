// needs: marks, cast_types, triangle
// Walking a bounding volume hierarchy with one ray, near children first. Twin of
// `raycast/traverse.rs`; the buffers are made by `gpu/scene.rs`.

// Nodes of all hierarchies, two vectors each: the box's lowest corner and the first child (in a
// leaf, the first triangle); its highest corner and the number of triangles of a leaf, 0 in an
// inner node.
@group(0) @binding(12) var<storage, read> nodes: array<vec4u>;
// Triangles in the order of the leaves, three vectors each: a corner, and in w one component of the
// unit normal.
@group(0) @binding(13) var<storage, read> triangles: array<vec4f>;
// Number of each triangle within its hierarchy.
@group(0) @binding(14) var<storage, read> triangle_ids: array<u32>;

// Widens the far plane by a few units in the last place, so that rounding never culls a box that
// the ray meets (Ize: "Robust BVH Ray Traversal", JCGT 2(2), 2013; wider here because shader
// division is less exact).
const FAR: f32 = 1.000001;
// Lower limit of the magnitude of a direction's components.
const SMALLEST: f32 = 1e-30;
// Maximum depth of a hierarchy; deeper ones are left to the CPU.
const LEVELS: u32 = 48u;

// A hierarchy at an instant.
struct Tree {
    // Rows of the pose that transforms from the rig's frame to the hierarchy's own.
    x: vec4f,
    y: vec4f,
    z: vec4f,
    // Index of its first node.
    nodes: u32,
    // Index of its first triangle in `triangles`.
    triangles: u32,
    // Number of its first triangle among the world's surfaces.
    first: u32,
    // Number of triangles.
    count: u32,
    // For a deforming mesh, the number of the shape that this row sees. A few shapes are stored for
    // the time between the frame's first and last row.
    shape: u32,
    spare_0: u32,
    spare_1: u32,
    spare_2: u32,
}

// An intersection: the ray parameter, and where the triangle is stored.
struct Found {
    t: f32,
    triangle: u32,
}

fn inverse_of(direction: vec3f) -> vec3f {
    let small = select(vec3f(SMALLEST), vec3f(-SMALLEST), direction < vec3f(0.0));
    return 1.0 / select(direction, small, abs(direction) < vec3f(SMALLEST));
}

// Result of testing a ray against a node: the parameter at which it enters the box (`NEVER` if it
// does not before its end); the first child, or first triangle of a leaf; the number of triangles
// of a leaf.
struct Entry {
    t: f32,
    first: u32,
    count: u32,
}

fn entry(index: u32, origin: vec3f, inverse: vec3f, end: f32) -> Entry {
    let lowest = nodes[2u * index];
    let highest = nodes[2u * index + 1u];
    let low = (bitcast<vec3f>(lowest.xyz) - origin) * inverse;
    let high = (bitcast<vec3f>(highest.xyz) - origin) * inverse;
    let enter = min(low, high);
    let leave = max(low, high);
    let near = max(max(enter.x, enter.y), max(enter.z, 0.0));
    let far = min(min(leave.x, leave.y), leave.z) * FAR;
    return Entry(select(NEVER, near, near <= min(far, end)), lowest.w, highest.w);
}

// Nearest intersection of a ray with a hierarchy's triangles between two parameters, or an
// arbitrary one if `any` is set. The triangle `own`, numbered within the hierarchy, is ignored.
fn walk(tree: Tree, origin: vec3f, direction: vec3f, start: f32, end: f32, own: u32, any: bool) -> Found {
    var found = Found(end, NO_SURFACE);
    let inverse = inverse_of(direction);
    let shear = shear_of(direction);
    var stack: array<u32, LEVELS>;
    var entries: array<f32, LEVELS>;
    var height = 0u;
    var node = entry(tree.nodes, origin, inverse, end);
    if node.t == NEVER {
        return found;
    }
    // Each round visits one node and no node is visited twice. A hierarchy of `count` triangles has
    // fewer than 2 * count nodes.
    for (var round = 0u; round < 2u * tree.count; round++) {
        var down = false;
        if node.count > 0u {
            let stop = tree.triangles + node.first + node.count;
            for (var i = tree.triangles + node.first; i < stop; i++) {
                let a = triangles[3u * i].xyz - origin;
                let b = triangles[3u * i + 1u].xyz - origin;
                let c = triangles[3u * i + 2u].xyz - origin;
                let t = meet(a, b, c, shear);
                if t > start && t < found.t && triangle_ids[i] != own {
                    found = Found(t, i);
                    if any {
                        return found;
                    }
                }
            }
        } else {
            let child = tree.nodes + node.first;
            let left = entry(child, origin, inverse, found.t);
            let right = entry(child + 1u, origin, inverse, found.t);
            let swap = right.t < left.t;
            let far = max(left.t, right.t);
            if far < NEVER && height < LEVELS {
                stack[height] = select(child + 1u, child, swap);
                entries[height] = far;
                height++;
            }
            down = min(left.t, right.t) < NEVER;
            node.first = select(left.first, right.first, swap);
            node.count = select(left.count, right.count, swap);
        }
        // A node on the stack may lie beyond an intersection found since it was pushed.
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
