// needs: skin_types
// What the geometry pass has left of skin, as the exposure pass reads it. Twin of `skin/maps.rs`.

// Of each pixel.
@group(0) @binding(90) var<storage, read> under_skin: array<UnderSkin>;
// Of each sample of the mixed pixels, sixteen a head, whose places are origins already.
@group(0) @binding(91) var<storage, read> mixed_skin: array<UnderSkin>;
