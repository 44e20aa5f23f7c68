// needs: marks
// Per-pixel maps, row-major, as the geometry pass writes them. Twin of
// `exposure/buffer.rs`.

// Projector coordinate that lights the pixel's centre; 0 if no surface is seen.
@group(0) @binding(0) var<storage, read_write> place: array<vec2f>;
// Derivatives of x, then of y, by the camera's column and row.
@group(0) @binding(1) var<storage, read_write> slopes: array<vec4f>;
// Electrons per second of projector light under full white (0 if unlit), then of ambient light.
@group(0) @binding(2) var<storage, read_write> light: array<vec2f>;
// Unit normal on the camera's side, and depth in millimetres; 0 if no surface is seen.
@group(0) @binding(3) var<storage, read_write> seen: array<vec4f>;
// Surface seen by the pixel's centre.
@group(0) @binding(4) var<storage, read_write> surface: array<u32>;
// Bits `Truth::SEEN` and so on.
@group(0) @binding(5) var<storage, read_write> marks: array<u32>;
// One bit for each lamp that lights the pixel's centre.
@group(0) @binding(6) var<storage, read_write> lamp_bits: array<u32>;
// Amplitude of the flicker of the ambient light, in electrons per second.
@group(0) @binding(7) var<storage, read_write> flickering: array<f32>;
// Standard deviation of the projector's blur along x in projector pixels.
@group(0) @binding(8) var<storage, read_write> blur: array<f32>;
// Electrons per second for 1 W/m^2 of light that is uniform over all directions.
@group(0) @binding(9) var<storage, read_write> evenly: array<f32>;
