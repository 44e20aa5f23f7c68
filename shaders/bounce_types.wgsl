// What bounces, ready for frames: points at which light is gathered, the rays of each, and what
// each pixel takes from there. Twin of `Bounce` in `bounce/mod.rs`.
//
// Each ray is four numbers an axis of the slide, in `bounce_x` and `bounce_y`: the coordinate where it
// ends, its derivatives by the two sides of the ray's part of the hemisphere, and the irradiance in
// W/m^2 that it brings under full white. An axis that no slide varies along has none.

struct BounceParams {
    // The camera's pixels.
    width: u32,
    height: u32,
    // Places of the grid, and from one to the next in pixels.
    columns: u32,
    rows: u32,
    step: u32,
    // Rays of a point.
    samples: u32,
    // Points of the grid and beside it.
    points: u32,
    spare: u32,
}

// No pixel: a place of the grid that sees nothing.
const NO_PIXEL: u32 = 0xffffffffu;

struct BouncePoint {
    // Whose centre it is, or NO_PIXEL.
    pixel: u32,
    // The first of its rays, and how many there are: those that end in the projector's light.
    first: u32,
    kept: u32,
    // Irradiance in W/m^2 under full white.
    white: f32,
}
