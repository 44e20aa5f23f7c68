// needs: cast_types
// The watertight ray/triangle test (Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection", JCGT
// 2(1), 2013), and where the ray meets the triangle's plane. Twin of `raycast/triangle.rs` and `render/triangle.rs`.
//
// Corners are relative to the ray's origin. Drivers may fuse multiplications and additions as they
// like, so that two triangles need not compute the function of a common edge from the same numbers:
// what is within rounding of an edge belongs to both.

// Rounding of an edge function relative to the square of its largest coordinate.
const EDGE: f32 = 1.2e-7;

// The permutation that makes a ray's largest component z, and its shear along it.
struct Shear {
    last: u32,
    by: vec3f,
}

// v.yzx where x comes last, v.zxy where y does.
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
    // Edge-on: its neighbours, which reach as far beyond their edges, are met instead.
    if abs(det) <= rounding {
        return NEVER;
    }
    let depth = vec3f(a.z, b.z, c.z) * shear.by.z;
    let t = dot(vec3f(u, v, w), depth) / det;
    let low = min(min(depth.x, depth.y), depth.z);
    return clamp(t, low, max(max(depth.x, depth.y), depth.z));
}

// The parameter at which a ray that meets the triangle does so, from its plane, kept within the
// parameters of the corners: edge-on the plane says nothing.
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
