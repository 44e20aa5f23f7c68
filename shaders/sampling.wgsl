// Parameters of the passes that cast several rays per pixel, the same for all rays; filled by
// `gpu/sampled.rs`.

struct Sampling {
    // Columns and rows of the camera.
    size: vec2u,
    // Number of rows that see the same instant of the scene: the side of a tile, or one.
    rows: u32,
    // Number of heads of mixed pixels that fit in the buffer.
    room: u32,
    // Width of a pixel at unit depth.
    pixel_slope: f32,
    // Inverse distance of the plane in focus, in 1/mm.
    focus: f32,
    // The pupil's radius in millimetres times the focal length in pixel widths.
    spread: f32,
    // Start of the tiles' rotations and of the objects' flags in the tables; the points of the
    // pupil come first.
    turns: u32,
    varies: u32,
    // Width of a pixel over its height.
    pixel_aspect: f32,
    spare_a: u32,
    spare_b: u32,
    // Points of the pupil in millimetres, one for each sample of a pixel, before a tile's rotation;
    // cosine and sine of the rotation of each tile of sixteen pixels; one bit for each object whose
    // albedo varies.
    tables: array<vec2u>,
}

@group(0) @binding(50) var<storage, read> sampling: Sampling;
