// needs: cast_types
// The watertight ray/triangle test (Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection",
// JCGT 2(1), 2013), and the intersection of the ray with the triangle's plane. Twin of
// `raycast/triangle.rs` and `scene/triangle.rs`.
//
// Corners are relative to the ray's origin. Drivers may fuse multiplications and additions, so two
// triangles may compute the function of their common edge with different rounding: a point within
// rounding of an edge belongs to both.

// Rounding error of an edge function, relative to the square of its largest coordinate.
const EDGE: f32 = 1.2e-7;

// Permutation that moves a ray's largest component to z, and the ray's shear along z.
struct Shear {
    last: u32,
    by: vec3f,
}

// v.yzx if x is moved to z, v.zxy if y is.
fn permuted(v: vec3f, last: u32) -> vec3f {
    return select(select(v.zxy, v.yzx, last == 0u), v, last == 2u);
}

fn shear_of(direction: vec3f) -> Shear {
    let size = abs(direction);
    var last = 2u;
    if size.x > size.z && size.x >= size.y {
        last = 0u;
    } else if size.y > size.z {
        last = 1u;
    }
    let d = permuted(direction, last);
    return Shear(last, vec3f(d.x / d.z, d.y / d.z, 1.0 / d.z));
}

// Ray parameter at which the ray meets the triangle; `NEVER` if it does not.
fn meet(corner_a: vec3f, corner_b: vec3f, corner_c: vec3f, shear: Shear) -> f32 {
    let a = permuted(corner_a, shear.last);
    let b = permuted(corner_b, shear.last);
    let c = permuted(corner_c, shear.last);
    let p = a.xy - shear.by.xy * a.z;
    let q = b.xy - shear.by.xy * b.z;
    let r = c.xy - shear.by.xy * c.z;
    let u = r.x * q.y - r.y * q.x;
    let v = p.x * r.y - p.y * r.x;
    let w = q.x * p.y - q.y * p.x;
    let most = max(max(abs(p), abs(q)), abs(r));
    let size = max(most.x, most.y);
    let rounding = EDGE * size * size;
    if min(min(u, v), w) < -rounding && max(max(u, v), w) > rounding {
        return NEVER;
    }
    let det = u + v + w;
    // Edge-on: the ray hits the neighbours instead, which reach just as far beyond their edges.
    if abs(det) <= rounding {
        return NEVER;
    }
    let depth = vec3f(a.z, b.z, c.z) * shear.by.z;
    let t = dot(vec3f(u, v, w), depth) / det;
    let low = min(min(depth.x, depth.y), depth.z);
    return clamp(t, low, max(max(depth.x, depth.y), depth.z));
}

// Ray parameter of a known intersection, computed from the triangle's plane and clamped to the
// parameters of the corners, because an edge-on plane determines nothing.
fn solve(corner_a: vec3f, corner_b: vec3f, corner_c: vec3f, normal: vec3f, direction: vec3f, near: f32) -> f32 {
    let shear = shear_of(direction);
    let depth = shear.by.z * vec3f(
        permuted(corner_a, shear.last).z,
        permuted(corner_b, shear.last).z,
        permuted(corner_c, shear.last).z,
    );
    let low = min(min(depth.x, depth.y), depth.z);
    let high = max(max(depth.x, depth.y), depth.z);
    let facing = dot(normal, direction);
    if abs(facing) < 1e-12 {
        return near;
    }
    return clamp(dot(normal, corner_a) / facing, low, high);
}
