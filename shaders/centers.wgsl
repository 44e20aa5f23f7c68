// needs: marks
// The per-pixel maps as read by the passes that cast several rays per pixel; those passes also mark
// pixels as creases.

// Some of the pixel's samples disagree with the closed form of its footprint. Used only within
// these passes.
const UNEVEN: u32 = 256u;

@group(0) @binding(0) var<storage, read> place: array<vec2f>;
@group(0) @binding(1) var<storage, read> slopes: array<vec4f>;
@group(0) @binding(3) var<storage, read> seen: array<vec4f>;
@group(0) @binding(4) var<storage, read> surface: array<u32>;
@group(0) @binding(5) var<storage, read_write> marks: array<u32>;
@group(0) @binding(6) var<storage, read> lamp_bits: array<u32>;
