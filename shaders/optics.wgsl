// needs: lens
// Constants that convert geometry into electrons, the same for all samples. Twin of
// `Optics` in `exposure/shade.rs`; filled by `gpu/optics.rs`.

// Vignetting of a lens: a2, a4, a6 of the polynomial and one over half of the image's diagonal in
// ideal coordinates; whether there is natural (cosine) falloff, and the power of the cosine.
struct Falloff {
    terms: vec4f,
    natural: u32,
    cosines: u32,
    spare_0: u32,
    spare_1: u32,
}

struct Optics {
    camera: Lens,
    projector: Lens,
    // Axes of the projector in the rig's frame: x, y and the optical axis; the w components hold
    // the position of its pupil.
    projector_x: vec4f,
    projector_y: vec4f,
    projector_z: vec4f,
    // Vignetting of the camera and of the projector.
    seen: Falloff,
    shown: Falloff,
    // Electrons per second of a pixel that sees a white surface under 1 W/m^2.
    electrons_per_irradiance: f32,
    // Electrons per second of a pixel that sees a white surface 1 mm from the projector, under the
    // projector's full white.
    projected: f32,
    // Electrons per second of a pixel that sees a white surface under the ambient light.
    ambient: f32,
    // Amplitude of the ambient light's flicker relative to its mean.
    ambient_depth: f32,
    // Defocus of the projector: fx times aperture / 4, and one over the focus distance.
    defocus_strength: f32,
    defocus_sharp: f32,
    lamps: u32,
    // Blur of the projector along y over that along x, each in projector pixels.
    defocus_aspect: f32,
}

@group(0) @binding(10) var<storage, read> optics: array<Optics, 1>;

// The projector's pupil in the rig's frame.
fn projector_pupil() -> vec3f {
    return vec3f(optics[0].projector_x.w, optics[0].projector_y.w, optics[0].projector_z.w);
}
