// needs: marks
// A ray of the camera, and what is known of where it ends. Twin of the types of `world.rs`, `shade.rs` and `geometry.rs`.

// Ray parameter of what is not there.
const NEVER: f32 = 3e38;

// A ray of the camera from a point of its pupil.
struct Ray {
    origin: vec3f,
    // Side in pixels of the square that it stands for.
    cell: f32,
    // With z = 1.
    direction: vec3f,
    // Whose instant of the scene it sees.
    row: u32,
}

// Where a ray meets the world.
struct Hit {
    // Ray parameter, with a direction of z = 1 the depth; `NEVER` where there is no surface.
    t: f32,
    surface: u32,
    // Unit normal on the ray's side.
    normal: vec3f,
    // The surface if it is a triangle, else `NO_SURFACE`.
    triangle: u32,
    // Where that is stored: its place in `triangles` (see `bvh.wgsl`), else `NO_SURFACE`.
    stored: u32,
    // Place in `trees` (see `world.wgsl`) of the hierarchy that it belongs to.
    tree: u32,
}

fn no_hit() -> Hit {
    return Hit(NEVER, NO_SURFACE, vec3f(0.0), NO_SURFACE, NO_SURFACE, 0u);
}

// A sample of the surface that a ray meets.
struct Shaded {
    // From the ray's origin along the rig's axes in millimetres.
    point: vec3f,
    // Projector pixel that lights the point.
    px: vec2f,
    // Derivatives of the projector pixel by the camera's: x by u, x by v, y by u, y by v.
    footprint: vec4f,
    // Electrons per second under full white, shadow aside.
    projected: f32,
    // Electrons per second of ambient light.
    ambient: f32,
    // Electrons per second by which ambient light and lamps swing about their mean.
    flickering: f32,
    // Electrons per second for 1 W/m^2 of light that is the same from everywhere.
    evenly: f32,
    // A bit for each lamp that lights it.
    lamps: u32,
    // The projector can light it, shadow aside: in its field and on its side.
    reachable: bool,
    // Both rays strike within 80 degrees of the normal.
    square: bool,
}

// A ray with all that is known of where it ends, and whether the projector lights that.
struct Cast {
    hit: Hit,
    shaded: Shaded,
    lit: bool,
}
