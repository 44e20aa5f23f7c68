// needs: skin_types
// Subsurface scattering as the exposure pass reads it. Twin of `exposure/skin_maps.rs`.

// For each pixel.
@group(0) @binding(90) var<storage, read> under_skin: array<UnderSkin>;
// For each sample of the mixed pixels, sixteen per head; their `place` is already the origin of the
// light.
@group(0) @binding(91) var<storage, read> mixed_skin: array<UnderSkin>;
