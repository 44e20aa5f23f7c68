// Pixels that are the mean of several samples. Twin of `Mixed` in `buffer.rs`.
//
// A head a group of sixteen samples: (pixel, groups, bits of ambient, bits of flickering), the last
// two in electrons per second, averaged. A pixel with more samples has several heads one after the
// other, whose electrons add up in their order: `groups` says how many on the first of them and is 0
// on the others. In what order pixels come differs from run to run.

// Samples of a head.
const MIXED_LANES: u32 = 16u;

// One sample; all zero where it is unlit.
struct MixedSample {
    // Projector coordinate that it is lit from.
    place: vec2f,
    // Derivatives of x by the camera's column and row, over the sample's part of the pixel.
    slopes_x: vec2f,
    // The same of y.
    slopes_y: vec2f,
    // Electrons per second under full white.
    projected: f32,
    // Standard deviation of the projector's blur in slide pixels; 0 without defocus.
    blur: f32,
}
