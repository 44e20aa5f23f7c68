// How light spreads under skin, as the geometry pass leaves it and the exposure pass reads it. Twin
// of `skin/maps.rs`, of `skin/mixture.rs` and of `Spread` of `light/blend.rs`.

// Most Gaussians of a tissue.
const MOST_GAUSSIANS: u32 = 8u;
// Index of no tissue.
const NO_TISSUE: u32 = 0xffffu;

// What light does under one point of skin, on the slide.
struct UnderSkin {
    // Projector coordinate that the light comes from; the point's own where it is not lit skin.
    origin: vec2f,
    // Slide pixels a millimetre of skin along the gradients of column and row.
    px_per_mm: vec2f,
    // `NO_TISSUE` where it is not lit skin.
    tissue: u32,
    unused: u32,
}

// Eight Gaussians of each tissue, widest first: weight, standard deviation in millimetres, and how
// many of those matter. What is left of the eight weighs nothing.
@group(0) @binding(93) var<storage, read> mixtures: array<vec4f>;
