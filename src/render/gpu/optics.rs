//! Parameters that convert geometry to electrons, in the layout of `optics.wgsl`.

use super::Engine;
use crate::exposure::{Falloff, Optics};
use bytemuck::{Pod, Zeroable};
use phasmid_geometry::Lens;

/// Twin of `Lens` in `lens.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct LensData {
    focal: [f32; 2],
    principal: [f32; 2],
    size: [f32; 2],
    scale: [f32; 2],
    k: [f32; 4],
    k3: f32,
    unfolded: f32,
    distorted: u32,
    spare: u32,
}

impl LensData {
    pub(super) fn new(lens: &Lens) -> Self {
        let [k1, k2, p1, p2, k3] = lens.distortion.map(|k| k as f32);
        Self {
            focal: lens.focal_px.as_vec2().to_array(),
            principal: lens.principal_px.as_vec2().to_array(),
            size: [lens.width_px, lens.height_px].map(|n| n as f32),
            scale: (1.0 / lens.focal_px).as_vec2().to_array(),
            k: [k1, k2, p1, p2],
            k3,
            unfolded: lens.unfolded_radius() as f32,
            distorted: lens.is_distorted().into(),
            spare: 0,
        }
    }
}

/// Twin of `Falloff` in `optics.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct FalloffData {
    terms: [f32; 4],
    natural: u32,
    cosines: u32,
    spare: [u32; 2],
}

impl FalloffData {
    fn new(falloff: &Falloff) -> Self {
        let [a2, a4, a6] = falloff.vignetting.falloff.map(|a| a as f32);
        Self {
            terms: [a2, a4, a6, (1.0 / falloff.unit) as f32],
            natural: falloff.vignetting.natural.into(),
            cosines: falloff.cosines as u32,
            spare: [0; 2],
        }
    }
}

/// Twin of `Optics` in `optics.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct OpticsData {
    camera: LensData,
    projector: LensData,
    /// Axes of the projector in the rig's frame; the fourth components hold its pupil.
    axes: [[f32; 4]; 3],
    seen: FalloffData,
    shown: FalloffData,
    electrons_per_irradiance: f32,
    projected: f32,
    ambient: f32,
    ambient_depth: f32,
    defocus_strength: f32,
    defocus_sharp: f32,
    lamps: u32,
    defocus_aspect: f32,
}

/// Uploads the optics to the buffer `optics`.
pub(crate) fn write(engine: &mut Engine, optics: &Optics) {
    let pose = &optics.projector.rig_from_view;
    let axes = std::array::from_fn(|i| {
        let axis = pose.rotation.col(i).extend(pose.translation_mm[i]);
        axis.as_vec4().to_array()
    });
    let scale = optics.electrons_per_irradiance;
    let data = OpticsData {
        camera: LensData::new(&optics.camera.lens),
        projector: LensData::new(&optics.projector.lens),
        axes,
        seen: FalloffData::new(&optics.seen),
        shown: FalloffData::new(&optics.shown),
        electrons_per_irradiance: scale as f32,
        projected: (scale * optics.intensity_w_sr * 1e6) as f32,
        ambient: (scale * optics.ambient_w_m2) as f32,
        ambient_depth: optics.ambient_depth as f32,
        defocus_strength: optics.defocus.strength as f32,
        defocus_sharp: optics.defocus.sharp as f32,
        lamps: optics.lamps.len() as u32,
        defocus_aspect: optics.defocus.aspect as f32,
    };
    engine.write("optics", bytemuck::bytes_of(&data));
}
