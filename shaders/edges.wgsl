// needs: plan, world, sampling
// Distinguishes one smooth, evenly lit surface from two. Twin of `Edges` in
// `transport/mixed.rs`.

// Triangles of one mesh whose normals differ by less than 15 degrees form one smooth surface.
const COS_CREASE: f32 = 0.9659258;

// Quantities that decide whether two points belong to one smooth surface.
struct Place {
    normal: vec3f,
    depth: f32,
    // Direction of the ray, with z = 1.
    direction: vec3f,
    surface: u32,
    // One bit for each lamp that lights the point.
    lamps: u32,
    lit: bool,
}

// Whether an edge of the surface or of its illumination runs between two points.
fn edge(a: Place, b: Place) -> bool {
    if a.lit != b.lit || a.lamps != b.lamps {
        return true;
    }
    if a.surface == b.surface {
        return false;
    }
    if a.surface == NO_SURFACE || b.surface == NO_SURFACE {
        return true;
    }
    return !one_mesh(a.surface, b.surface) || dot(a.normal, b.normal) < COS_CREASE || jump(a, b);
}

// Whether two surfaces are triangles of one mesh.
fn one_mesh(a: u32, b: u32) -> bool {
    return is_triangle(a) && is_triangle(b) && object_of(a) == object_of(b);
}

// Whether b lies off the tangent plane at a by more than a pixel's size on the surface.
fn jump(a: Place, b: Place) -> bool {
    let facing = dot(a.normal, b.direction);
    // A plane seen edge-on does not determine where b is.
    if abs(facing) < 1e-12 {
        return true;
    }
    let predicted = dot(a.normal, a.direction) * a.depth / facing;
    let cos = max(-facing / length(b.direction), 0.05);
    return abs(predicted - b.depth) > a.depth * sampling.pixel_slope / cos;
}
