// needs: cast_types
// Shapes with a closed form: intersected in their own frame. Twin of `geometry/solid.rs`.
//
// They stand on z = 0 and extend towards -z. All of them are convex.

const PLANE: u32 = 0u;
const SPHERE: u32 = 1u;
const CYLINDER: u32 = 2u;
const FRUSTUM: u32 = 3u;

// A solid: rows of the pose from the rig's frame to its own, and its size: half sides of a plane;
// radius of a sphere; radius and half length of a cylinder; for a frustum, the outward and upward
// components of the side faces' normal, their offset, and the height.
struct Solid {
    x: vec4f,
    y: vec4f,
    z: vec4f,
    size: vec4f,
    kind: u32,
    object: u32,
    // The camera is inside and sees the inner wall, which the outer wall shades.
    around_camera: u32,
    spare: u32,
}

// Intersection of a ray with a solid: parameter, or `NEVER`; outward unit normal in the solid's
// frame; number of the smooth part.
struct SolidHit {
    t: f32,
    facet: u32,
    normal: vec3f,
}

// Parameters at which a line enters and leaves |p| = radius, and its closest approach; `near` is
// `NEVER` if the line misses.
struct Roots {
    near: f32,
    far: f32,
    approach: vec3f,
    // Distance from the closest approach to either root, along the line.
    half: f32,
}

fn no_meeting() -> SolidHit {
    return SolidHit(NEVER, 0u, vec3f(0.0));
}

// Avoids cancellation by forming the discriminant from the ray's closest approach (Haines et al.,
// "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019).
fn roots(o: vec3f, d: vec3f, radius: f32) -> Roots {
    let a = dot(d, d);
    if a <= 0.0 {
        return Roots(NEVER, NEVER, o, 0.0);
    }
    let middle = -dot(o, d) / a;
    let approach = o + d * middle;
    let away = length(approach);
    let square = (radius - away) * (radius + away) / a;
    if square < 0.0 {
        return Roots(NEVER, NEVER, approach, 0.0);
    }
    let half = sqrt(square);
    // The root nearer to the origin, as a quotient, so that its rounding error is relative to its
    // own size.
    let far = middle + select(half, -half, middle < 0.0);
    let distance = length(o);
    let other = (distance - radius) * (distance + radius) / (a * far);
    if far == 0.0 {
        return Roots(0.0, 0.0, approach, half);
    }
    return Roots(min(far, other), max(far, other), approach, half);
}

fn meet_plane(half: vec2f, o: vec3f, d: vec3f, start: f32) -> SolidHit {
    if d.z == 0.0 {
        return no_meeting();
    }
    let t = -o.z / d.z;
    let p = abs(o.xy + d.xy * t);
    if !(t > start && t < NEVER && all(p <= half)) {
        return no_meeting();
    }
    return SolidHit(t, 0u, vec3f(0.0, 0.0, -1.0));
}

fn meet_sphere(radius: f32, o: vec3f, d: vec3f, start: f32) -> SolidHit {
    let at = roots(o, d, radius);
    if at.near < NEVER && at.near > start {
        return SolidHit(at.near, 0u, (at.approach - d * at.half) / radius);
    }
    if at.near < NEVER && at.far > start {
        return SolidHit(at.far, 0u, (at.approach + d * at.half) / radius);
    }
    return no_meeting();
}

fn meet_cylinder(radius: f32, half_length: f32, o: vec3f, d: vec3f, start: f32) -> SolidHit {
    var hit = no_meeting();
    if d.y != 0.0 {
        for (var i = 0u; i < 2u; i++) {
            let sign = select(-1.0, 1.0, i == 0u);
            let t = (sign * half_length - o.y) / d.y;
            let p = o.xz + d.xz * t;
            if t > start && t < hit.t && length(p) <= radius {
                hit = SolidHit(t, i + 1u, vec3f(0.0, sign, 0.0));
            }
        }
    }
    let flat_d = vec3f(d.x, 0.0, d.z);
    let at = roots(vec3f(o.x, 0.0, o.z), flat_d, radius);
    if at.near == NEVER {
        return hit;
    }
    // Both roots must be tested: the near one may lie beyond the cylinder's end.
    if at.near > start && at.near < hit.t && abs(o.y + d.y * at.near) <= half_length {
        return SolidHit(at.near, 0u, (at.approach - flat_d * at.half) / radius);
    }
    if at.far > start && at.far < hit.t && abs(o.y + d.y * at.far) <= half_length {
        return SolidHit(at.far, 0u, (at.approach + flat_d * at.half) / radius);
    }
    return hit;
}

// Outward unit normal and offset of the top, the base and the four sides.
fn frustum_face(size: vec4f, i: u32) -> vec4f {
    switch i {
        case 0u: { return vec4f(0.0, 0.0, -1.0, size.w); }
        case 1u: { return vec4f(0.0, 0.0, 1.0, 0.0); }
        case 2u: { return vec4f(size.x, 0.0, size.y, size.z); }
        case 3u: { return vec4f(-size.x, 0.0, size.y, size.z); }
        case 4u: { return vec4f(0.0, size.x, size.y, size.z); }
        default: { return vec4f(0.0, -size.x, size.y, size.z); }
    }
}

// Intersects a convex body, given by half-spaces n . p <= offset, by clipping the ray (Cyrus and
// Beck 1978).
fn meet_frustum(size: vec4f, o: vec3f, d: vec3f, start: f32) -> SolidHit {
    var enter = -NEVER;
    var leave = NEVER;
    var enter_by = 0u;
    var leave_by = 0u;
    for (var i = 0u; i < 6u; i++) {
        let face = frustum_face(size, i);
        let speed = dot(face.xyz, d);
        let gap = face.w - dot(face.xyz, o);
        if speed == 0.0 {
            if gap < 0.0 {
                return no_meeting();
            }
            continue;
        }
        let t = gap / speed;
        if speed < 0.0 && t > enter {
            enter = t;
            enter_by = i;
        }
        if speed > 0.0 && t < leave {
            leave = t;
            leave_by = i;
        }
    }
    if enter > leave {
        return no_meeting();
    }
    if enter > start {
        return SolidHit(enter, enter_by, frustum_face(size, enter_by).xyz);
    }
    if leave > start && leave < NEVER {
        return SolidHit(leave, leave_by, frustum_face(size, leave_by).xyz);
    }
    return no_meeting();
}

// First intersection of a ray, in the solid's frame, with the surface at a parameter above `start`.
fn meet_solid(solid: Solid, o: vec3f, d: vec3f, start: f32) -> SolidHit {
    switch solid.kind {
        case PLANE: { return meet_plane(solid.size.xy, o, d, start); }
        case SPHERE: { return meet_sphere(solid.size.x, o, d, start); }
        case CYLINDER: { return meet_cylinder(solid.size.x, solid.size.y, o, d, start); }
        default: { return meet_frustum(solid.size, o, d, start); }
    }
}
