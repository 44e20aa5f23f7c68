// Fixed-pattern noise of one device, twin of sensor/fixed.rs, which draws it once: sensitivity
// relative to the mean of all pixels, and offset in electrons.

@group(0) @binding(77) var<storage, read> fixed_pattern: array<vec2f>;
