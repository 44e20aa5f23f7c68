// What sees pixels by several rays, the same for all of them: what `gpu/sampled.rs` fills in.

struct Sampling {
    // Columns and rows of the camera.
    size: vec2u,
    // Rows that see the same of the scene: the side of a tile, or one.
    rows: u32,
    // Heads of mixed pixels that there is room for.
    room: u32,
    // Width of a pixel at unit depth.
    pixel_slope: f32,
    // Inverse distance of the plane in focus, in 1/mm.
    focus: f32,
    // The pupil's radius in millimetres times the focal length in pixels.
    spread: f32,
    // Where the turns and the marks of objects begin in the tables; points of the pupil come first.
    turns: u32,
    varies: u32,
    spare_a: u32,
    spare_b: u32,
    spare_c: u32,
    // Points of the pupil in millimetres, one a sample of a pixel, before a tile's turn; cosine and
    // sine of the turn of each tile of sixteen pixels; a bit for each object whose albedo varies.
    tables: array<vec2u>,
}

@group(0) @binding(50) var<storage, read> sampling: Sampling;
