// needs: plan, laid, material_values
//
// The materials of all objects, laid out by gpu/materials.rs, and barycentric coordinates on
// triangles.

@group(0) @binding(30) var<storage, read> materials: array<Material>;

const NOTHING: u32 = 0xffffffffu;

// Indices into `material_values` are NOTHING for absent attributes.
struct Material {
    albedo: f32,
    lobe: u32,
    // Number of the object's first triangle among the world's.
    first_triangle: u32,
    // How a texture is mapped onto the object (`LAY_...`).
    lay: u32,
    // Smooth normals at triangle corners, in the frame of the object's hierarchy: nine numbers per
    // triangle.
    normals: u32,
    // Distance from the normals of one shape of a deforming mesh to the normals of the next.
    normals_step: u32,
    // Vertex colours: three numbers per triangle.
    colours: u32,
    // Texture coordinates: six numbers per triangle.
    coordinates: u32,
    // Rest positions of a deforming mesh: nine numbers per triangle.
    rest: u32,
    // For a texture: index of its sums, columns, rows, mean. For a board: columns, rows, mean.
    sums: u32,
    width: u32,
    height: u32,
    mean: f32,
    pad: u32,
    // Size of the texture on the object in millimetres.
    size_mm: vec2f,
    // Board: pitch, radii of a dot and of a marker in millimetres, albedo factor of ink.
    board: vec4f,
    // Pose from the frame of the object's hierarchy, or of the solid, to the object's own frame:
    // rows.
    own_from_there: mat3x4f,
}

// Whether an object's albedo varies over its surface.
fn material_varies(object: u32) -> bool {
    return materials[object].colours != NOTHING || materials[object].lay != LAY_NONE;
}

// Whether material.wgsl applies the albedo later; until then the surface is lit as white.
fn material_is_white(object: u32) -> bool {
    return (has_specular && materials[object].lobe != NOTHING)
        || (has_albedo_maps && material_varies(object));
}

// Albedo that a surface is first lit with: its own, or white.
fn first_albedo(object: u32) -> f32 {
    return select(materials[object].albedo, 1.0, material_is_white(object));
}

// Change of the barycentric weights over a step in the triangle's plane (the columns of `corners`
// are its corners); huge for a degenerate triangle.
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

// Barycentric weights of a point in the triangle's plane, clamped to non-negative values.
fn barycentric(corners: mat3x3f, point: vec3f) -> vec3f {
    let step = shares(corners, point - corners[0]);
    let raw = max(vec3f(1.0 + step.x, step.y, step.z), vec3f(0.0));
    let sum = raw.x + raw.y + raw.z;
    // Rejects triangles without area and non-finite points.
    if !(sum > 0.0 && sum < 1e29) {
        return vec3f(1.0, 0.0, 0.0);
    }
    return raw / sum;
}
