// Pixels that are the mean of several samples. Twin of `Mixed` in `exposure/buffer.rs`.
//
// One head per group of sixteen samples: (pixel, groups, bits of ambient, bits of flickering), the
// last two in electrons per second, averaged. A pixel with more samples has several consecutive
// heads, whose electrons are summed in order: `groups` is their number in the first and 0 in the
// others. The order of the pixels differs from run to run.

// Samples per head.
const MIXED_LANES: u32 = 16u;

// One sample; all zero if it is unlit.
struct MixedSample {
    // Projector coordinate that lights it.
    place: vec2f,
    // Derivatives of x by the camera's column and row, over the sample's part of the pixel.
    slopes_x: vec2f,
    // The same of y.
    slopes_y: vec2f,
    // Electrons per second under full white.
    projected: f32,
    // Standard deviation of the projector's blur along x in projector pixels; 0 without defocus.
    blur: f32,
}
