// needs: marks
// A camera ray and the surface sample where it ends. Twin of the types of `scene/hits.rs`,
// `transport/rays.rs` and `transport/cast.rs`.

// Ray parameter that stands for "no intersection".
const NEVER: f32 = 3e38;

// A camera ray that starts at a point of the pupil.
struct Ray {
    origin: vec3f,
    // Side in pixels of the square that it represents.
    cell: f32,
    // With z = 1.
    direction: vec3f,
    // Sensor row; the ray sees the scene at that row's instant.
    row: u32,
}

// Where a ray meets the world.
struct Hit {
    // Ray parameter, which is the depth if the direction has z = 1; `NEVER` if no surface was hit.
    t: f32,
    surface: u32,
    // Unit normal on the ray's side.
    normal: vec3f,
    // The surface if it is a triangle, else `NO_SURFACE`.
    triangle: u32,
    // Index of the triangle in `triangles` (see `bvh.wgsl`), else `NO_SURFACE`.
    stored: u32,
    // Index in `trees` (see `world.wgsl`) of the triangle's hierarchy.
    tree: u32,
}

fn no_hit() -> Hit {
    return Hit(NEVER, NO_SURFACE, vec3f(0.0), NO_SURFACE, NO_SURFACE, 0u);
}

// A sample of the surface that a ray meets.
struct Shaded {
    // Position relative to the ray's origin, along the rig's axes, in millimetres.
    point: vec3f,
    // Projector pixel that lights the point.
    px: vec2f,
    // Derivatives of the projector pixel by the camera's: x by u, x by v, y by u, y by v.
    footprint: vec4f,
    // Electrons per second under full white, ignoring shadows.
    projected: f32,
    // Electrons per second of ambient light.
    ambient: f32,
    // Amplitude of the flicker of ambient and lamp light, in electrons per second.
    flickering: f32,
    // Electrons per second for 1 W/m^2 of light that is uniform over all directions.
    evenly: f32,
    // One bit for each lamp that lights the point.
    lamps: u32,
    // The projector can light the point, ignoring shadows: it lies in the field of view and faces
    // the projector.
    reachable: bool,
    // Both the camera's and the projector's ray are within 80 degrees of the normal.
    square: bool,
}

// Everything known about where a ray ends, including whether the projector lights that point.
struct Cast {
    hit: Hit,
    shaded: Shaded,
    lit: bool,
}
