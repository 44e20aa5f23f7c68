// Subsurface scattering data, written by the geometry pass and read by the exposure pass. Twin of
// `exposure/skin_maps.rs`, of `skin/mixture.rs` and of `Spread` of `exposure/blend.rs`.

// Maximum number of Gaussians of a tissue.
const MOST_GAUSSIANS: u32 = 8u;
// Index that stands for no tissue.
const NO_TISSUE: u32 = 0xffffu;

// Subsurface scattering at one point of skin, on the pattern image.
struct UnderSkin {
    // Projector coordinate that the light comes from; the point's own if it is not lit skin.
    origin: vec2f,
    // Projector pixels per millimetre of skin along the gradients of column and row.
    px_per_mm: vec2f,
    // `NO_TISSUE` if it is not lit skin.
    tissue: u32,
    unused: u32,
}

// Eight Gaussians for each tissue, widest first: weight, standard deviation in millimetres, and the
// reach in standard deviations. Unused Gaussians have zero weight.
@group(0) @binding(93) var<storage, read> mixtures: array<vec4f>;
