// needs: marks, cast_types, triangle
// Walking a bounding volume hierarchy with one ray, near children first. Twin of `raycast/traverse.rs`;
// the buffers are made by `gpu/scene.rs`.

// Nodes of all hierarchies, two vectors each: the box's lowest corner and the first child, or first
// triangle of a leaf; its highest corner and the number of a leaf's triangles, 0 in an inner node.
@group(0) @binding(12) var<storage, read> nodes: array<vec4u>;
// Triangles in the order of leaves, three vectors each: a corner, and in the fourth place a component
// of the unit normal.
@group(0) @binding(13) var<storage, read> triangles: array<vec4f>;
// Their numbers among their hierarchy's.
@group(0) @binding(14) var<storage, read> triangle_ids: array<u32>;

// Widens the far plane by some units in the last place, so that rounding never culls a box that the
// ray meets (Ize: "Robust BVH Ray Traversal", JCGT 2(2), 2013); divisions of shaders are less exact.
const FAR: f32 = 1.000001;
// Smaller components of a direction count as this small.
const SMALLEST: f32 = 1e-30;
// Levels of a hierarchy; deeper ones are left to the CPU.
const LEVELS: u32 = 48u;

// A hierarchy at an instant.
struct Tree {
    // Rows of the pose that takes the rig's frame to its own.
    x: vec4f,
    y: vec4f,
    z: vec4f,
    // Where its nodes and its triangles begin.
    nodes: u32,
    triangles: u32,
    // Number of its first triangle among the world's surfaces, and how many there are.
    first: u32,
    count: u32,
    // Which of the shapes of what deforms, between a frame's first row and its last, its row sees.
    shape: u32,
    spare_0: u32,
    spare_1: u32,
    spare_2: u32,
}

// A meeting: its parameter, and where the triangle is stored.
struct Found {
    t: f32,
    triangle: u32,
}

fn inverse_of(direction: vec3f) -> vec3f {
    let small = select(vec3f(SMALLEST), vec3f(-SMALLEST), direction < vec3f(0.0));
    return 1.0 / select(direction, small, abs(direction) < vec3f(SMALLEST));
}

// What a ray finds at a node: the parameter at which it enters the box, `NEVER` if it does not before
// its end; the first child, or first triangle of a leaf; the number of a leaf's triangles.
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

// The nearest meeting of a ray with a hierarchy's triangles between two parameters, or, if `any` will
// do, one of them; `own`, a number among the hierarchy's, does not count.
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
    // Each round visits a node, and none twice.
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
        // A node on the stack may have fallen behind what has been met since.
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
