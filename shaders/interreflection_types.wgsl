// Interreflections, ready for frames: the points at which light is gathered, the rays of each, and
// the weights with which each pixel uses the points. Twin of `InterreflectionMap` in
// `exposure/indirect_map.rs`.
//
// Each ray has four numbers per axis of the pattern image, in `interreflection_x` and
// `interreflection_y`: the coordinate where it ends, its derivatives along the two sides of the
// ray's patch of the hemisphere, and the irradiance in W/m^2 that it contributes under full white.
// Nothing is stored for an axis along which no pattern image varies.

struct InterreflectionParams {
    // The camera's pixels.
    width: u32,
    height: u32,
    // Columns and rows of the grid, and its spacing in pixels.
    columns: u32,
    rows: u32,
    step: u32,
    // Rays per point.
    samples: u32,
    // Number of points: grid points and additional points.
    points: u32,
    spare: u32,
}

// No pixel: a grid position that sees no surface.
const NO_PIXEL: u32 = 0xffffffffu;

struct GatherPoint {
    // Pixel whose centre the point lies on, or NO_PIXEL.
    pixel: u32,
    // Index of its first ray. Only rays that end in the projector's light are kept.
    first: u32,
    // Number of its rays.
    kept: u32,
    // Irradiance in W/m^2 under full white.
    white: f32,
}
