// needs: plan
//
// Twin of material/lay.rs: maps a texture of a given size onto a shape, in millimetres of the
// shape's own frame.

// Kinds of texture mapping.
const LAY_NONE: u32 = 0u;
const LAY_CORNERS: u32 = 1u;
const LAY_ALONG: u32 = 2u;
const LAY_SPHERE: u32 = 3u;
const LAY_CYLINDER: u32 = 4u;

// A surface point with the sides of its patch, in the object's own frame at rest.
struct Own {
    point: vec3f,
    normal: vec3f,
    across: vec3f,
    down: vec3f,
}

// A position on a texture, with the sides of the patch.
struct Laid {
    at: vec2f,
    across: vec2f,
    down: vec2f,
}

// Maps a surface point to a position on the texture in millimetres.
fn laid_over(lay: u32, own: Own) -> Laid {
    let p = own.point;
    if lay == LAY_ALONG {
        return Laid(p.xy, own.across.xy, own.down.xy);
    }
    if lay == LAY_CYLINDER && abs(own.normal.y) > 0.5 {
        return Laid(p.xz, own.across.xz, own.down.xz);
    }
    let ring = length(p.xz);
    let radius = select(length(p), ring, lay == LAY_CYLINDER);
    // Angle about y and its gradient, both multiplied by the radius to give a length.
    let square = max(ring * ring, 1e-18 * radius * radius);
    let turn = vec3f(-p.z, 0.0, p.x) * (radius / square);
    let u = arc_tangent(p.x, -p.z) * radius;
    if lay == LAY_CYLINDER {
        return Laid(
            vec2f(u, p.y),
            vec2f(dot(turn, own.across), own.across.y),
            vec2f(dot(turn, own.down), own.down.y),
        );
    }
    let aside = max(ring, 1e-9 * radius);
    let up = vec3f(-p.x * p.y / aside, aside, -p.z * p.y / aside) / radius;
    return Laid(
        vec2f(u, arc_tangent(p.y, aside) * radius),
        vec2f(dot(turn, own.across), dot(up, own.across)),
        vec2f(dot(turn, own.down), dot(up, own.down)),
    );
}

// Angle of (x, y) in radians, within 2e-7: the built-in function may be far less accurate. The
// polynomial is that of Moshier's Cephes library (atanf).
fn arc_tangent(y: f32, x: f32) -> f32 {
    let high = max(abs(x), abs(y));
    let low = min(abs(x), abs(y));
    if !(high > 0.0) {
        return 0.0;
    }
    let slope = low / high;
    let steep = slope > 0.41421357;
    let t = select(slope, (low - high) / (low + high), steep);
    let z = t * t;
    let series = (((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z
        - 3.33329491539e-1) * z * t + t;
    var angle = select(series, series + 0.78539816, steep);
    angle = select(angle, 1.57079633 - angle, abs(y) > abs(x));
    angle = select(angle, 3.14159265 - angle, x < 0.0);
    return select(angle, -angle, y < 0.0);
}
