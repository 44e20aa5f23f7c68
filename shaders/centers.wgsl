// needs: marks
// The maps of pixels' centres, as the passes read them that see pixels by more rays; those flag
// pixels as creases.

// Some of the pixel's samples are not where the closed form of its footprint has them: a mark of
// these passes alone.
const UNEVEN: u32 = 256u;

@group(0) @binding(0) var<storage, read> place: array<vec2f>;
@group(0) @binding(1) var<storage, read> slopes: array<vec4f>;
@group(0) @binding(3) var<storage, read> seen: array<vec4f>;
@group(0) @binding(4) var<storage, read> surface: array<u32>;
@group(0) @binding(5) var<storage, read_write> marks: array<u32>;
@group(0) @binding(6) var<storage, read> lamp_bits: array<u32>;
