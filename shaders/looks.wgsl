// needs: plan, laid, look_values
//
// The looks of all objects, as gpu/looks.rs puts them, and places on triangles.

@group(0) @binding(30) var<storage, read> looks: array<Look>;

const NOTHING: u32 = 0xffffffffu;

// Places among the look's values are NOTHING where there is nothing there.
struct Look {
    albedo: f32,
    material: u32,
    // Of the object's first triangle among the world's.
    first_triangle: u32,
    // How a picture is laid on.
    lay: u32,
    // Of corners: smooth normals, nine numbers a triangle, in the frame of the object's hierarchy, and
    // from one of its shapes to the next; colours, three; texture coordinates, six; places at rest of
    // a mesh that deforms, nine.
    normals: u32,
    normals_step: u32,
    colours: u32,
    coordinates: u32,
    rest: u32,
    // Of the picture: place of its sums, columns, rows, mean. Of a board: columns, rows, mean.
    sums: u32,
    width: u32,
    height: u32,
    mean: f32,
    pad: u32,
    // Of the picture on the object in millimetres.
    size_mm: vec2f,
    // Pitch, radii of a dot and of a marker in millimetres, factor of ink.
    board: vec4f,
    // From the frame of the object's hierarchy, or of the solid, to its own: rows of a pose.
    own_from_there: mat3x4f,
}

// Whether an object's albedo varies over its surface.
fn look_varies(object: u32) -> bool {
    return looks[object].colours != NOTHING || looks[object].lay != LAY_NONE;
}

// Whether look.wgsl reflects its light; until then it is lit as white.
fn look_is_white(object: u32) -> bool {
    return (has_specular && looks[object].material != NOTHING)
        || (has_albedo_maps && look_varies(object));
}

// What a surface is first lit as: its albedo, or white.
fn first_albedo(object: u32) -> f32 {
    return select(looks[object].albedo, 1.0, look_is_white(object));
}

// By how much the weights of a triangle's corners, columns here, change over a step in its plane;
// far beyond all numbers where it is degenerate.
fn shares(corners: mat3x3f, step: vec3f) -> vec3f {
    let e1 = corners[1] - corners[0];
    let e2 = corners[2] - corners[0];
    let normal = cross(e1, e2);
    let area2 = dot(normal, normal);
    if !(area2 > 1e-36) {
        return vec3f(1e30);
    }
    let second = dot(cross(step, e2), normal) / area2;
    let third = dot(cross(e1, step), normal) / area2;
    return vec3f(-second - third, second, third);
}

// Weights of a triangle's corners at a point of its plane, not negative.
fn barycentric(corners: mat3x3f, point: vec3f) -> vec3f {
    let step = shares(corners, point - corners[0]);
    let raw = max(vec3f(1.0 + step.x, step.y, step.z), vec3f(0.0));
    let sum = raw.x + raw.y + raw.z;
    // Neither of no area nor of a point that is nowhere.
    if !(sum > 0.0 && sum < 1e29) {
        return vec3f(1.0, 0.0, 0.0);
    }
    return raw / sum;
}
