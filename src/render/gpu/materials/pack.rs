//! Packs the materials of objects into contiguous buffers, together with lookup tables for functions
//! that the shaders do not compute.

use crate::exposure::{density, distribution};
use crate::material::{Ggx, ImageMap, Lay, Map, Material, Place, Printed, Texture};
use crate::scene::{Blend, Instance, Surface, World};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use phasmid_geometry::{Board, Pose};
use std::sync::Arc;

/// Marks a missing offset.
const NOTHING: u32 = u32::MAX;
/// Modes in which a texture is mapped onto an object.
const LAY_NONE: u32 = 0;
const LAY_CORNERS: u32 = 1;
pub(super) const LAY_ALONG: u32 = 2;
pub(super) const LAY_SPHERE: u32 = 3;
pub(super) const LAY_CYLINDER: u32 = 4;
pub(super) const LAY_DOTS: u32 = 5;
pub(super) const LAY_CHESS: u32 = 6;

/// Twin of `Material` in `materials.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Packed {
    albedo: f32,
    lobe: u32,
    first_triangle: u32,
    lay: u32,
    normals: u32,
    normals_step: u32,
    colours: u32,
    coordinates: u32,
    rest: u32,
    sums: u32,
    width: u32,
    height: u32,
    mean: f32,
    pad: u32,
    size_mm: [f32; 2],
    board: [f32; 4],
    own_from_there: [[f32; 4]; 3],
}

/// The smooth normals of a mesh in one of its shapes.
pub(super) struct Deforming {
    pub(super) object: u16,
    pub(super) shape: usize,
    /// Offset of the normals among the material values.
    pub(super) at: u32,
    /// The shape that is currently on the GPU.
    pub(super) blend: Option<Blend>,
}

/// Material buffers that are being filled.
pub(super) struct Packer {
    pub(super) materials: Vec<Packed>,
    pub(super) values: Vec<f32>,
    pub(super) sums: Vec<[u32; 2]>,
    pub(super) deforming: Vec<Deforming>,
    /// Packed data that several objects may share.
    lobes: Vec<(Arc<Ggx>, u32)>,
    textures: Vec<(Arc<Texture>, u32)>,
}

impl Packer {
    /// Creates a packer that appends to `values`.
    pub(super) fn new(values: Vec<f32>) -> Self {
        Self {
            materials: Vec::new(),
            values,
            sums: Vec::new(),
            deforming: Vec::new(),
            lobes: Vec::new(),
            textures: Vec::new(),
        }
    }

    /// Adds all objects, in all shapes that they take on during a rolling-shutter exposure.
    pub(super) fn objects(&mut self, worlds: &[World]) {
        let world = &worlds[0];
        for (object, material) in (0u16..).zip(&world.materials.of) {
            let first = Surface(material.first_triangle as u32);
            let is_mesh = world.is_triangle(first) && world.object(first) == object;
            let instances = worlds.iter().filter_map(|world| world.instance_of(object));
            let instances: Vec<&Instance> = instances.collect();
            // Solids and moving meshes are kept in the frames of their objects.
            let is_here = is_mesh && instances.is_empty();
            self.object(object, material, &instances, is_here);
        }
        if self.materials.is_empty() {
            // A binding must hold at least one element.
            self.materials.push(Packed::zeroed());
        }
    }

    fn object(&mut self, object: u16, material: &Material, instances: &[&Instance], is_here: bool) {
        let mut packed = Packed {
            albedo: material.albedo as f32,
            lobe: NOTHING,
            first_triangle: material.first_triangle as u32,
            lay: LAY_NONE,
            normals: NOTHING,
            colours: NOTHING,
            coordinates: NOTHING,
            rest: NOTHING,
            ..Packed::zeroed()
        };
        if let Some(ggx) = &material.specular {
            packed.lobe = self.lobe(ggx);
        }
        if !material.normals.is_empty() {
            (packed.normals, packed.normals_step) = self.normals(object, material, instances);
        }
        if !material.colours.is_empty() {
            packed.colours = self.put(material.colours.iter().flatten().copied());
        }
        match &material.map {
            Some(Map::Image(image)) => {
                self.image(image, instances.first().copied(), is_here, &mut packed);
            }
            Some(Map::Board(printed)) => board(printed, &mut packed),
            None => {}
        }
        self.materials.push(packed);
    }

    /// Adds the smooth normals of a mesh, in the mesh's own frame if it moves. Returns the offset of
    /// the normals, and the stride between the mesh's shapes (0 if the mesh does not deform).
    fn normals(&mut self, object: u16, material: &Material, instances: &[&Instance]) -> (u32, u32) {
        let at = self.values.len() as u32;
        let first = instances.first();
        if first.is_none_or(|instance| instance.smooth_normals().is_empty()) {
            let rig_from_own =
                first.map_or(Pose::IDENTITY, |instance| instance.model().rig_from_rest);
            let turn = rig_from_own.inverse().rotation;
            let own = |n: &Vec3| (turn * n.as_dvec3()).as_vec3().to_array();
            return (self.put(material.normals.iter().flatten().flat_map(own)), 0);
        }
        for (shape, instance) in instances.iter().enumerate() {
            let at = self.put(flat(instance.smooth_normals()));
            self.deforming.push(Deforming {
                object,
                shape,
                at,
                blend: instance.blend(),
            });
        }
        (at, 9 * material.normals.len() as u32)
    }

    fn image(
        &mut self,
        image: &ImageMap,
        instance: Option<&Instance>,
        is_here: bool,
        packed: &mut Packed,
    ) {
        let texture = &image.texture;
        packed.sums = self.texture(texture);
        packed.mean = mean(texture);
        (packed.width, packed.height) = (texture.width as u32, texture.height as u32);
        match &image.place {
            Place::Corners(uv) => {
                packed.lay = LAY_CORNERS;
                // Image rows run downwards.
                let down = |[u, v]: [f32; 2]| [u, (1.0 - f64::from(v)) as f32];
                packed.coordinates = self.put(uv.iter().flatten().flat_map(|&uv| down(uv)));
            }
            Place::Over {
                lay,
                size_mm,
                object_from_rig,
            } => {
                packed.lay = number(*lay);
                packed.size_mm = size_mm.as_vec2().to_array();
                packed.own_from_there = rows(&match is_here {
                    true => *object_from_rig,
                    false => Pose::IDENTITY,
                });
                if let Some(instance) =
                    instance.filter(|instance| instance.deforming_triangles() > 0)
                {
                    let model = instance.model();
                    let corner = |&i: &u32| model.vertices[i as usize].as_vec3().to_array();
                    packed.rest = self.put(model.triangles.iter().flatten().flat_map(corner));
                }
            }
        }
    }

    fn lobe(&mut self, ggx: &Arc<Ggx>) -> u32 {
        if let Some((_, at)) = self.lobes.iter().find(|(had, _)| Arc::ptr_eq(had, ggx)) {
            return *at;
        }
        let at = self.put(lobe(ggx));
        self.lobes.push((ggx.clone(), at));
        at
    }

    fn texture(&mut self, texture: &Arc<Texture>) -> u32 {
        let known = self
            .textures
            .iter()
            .find(|(had, _)| Arc::ptr_eq(had, texture));
        if let Some((_, at)) = known {
            return *at;
        }
        let at = self.sums.len() as u32;
        self.sums.extend(sums(texture));
        self.textures.push((texture.clone(), at));
        at
    }

    /// Appends values and returns their offset.
    fn put(&mut self, values: impl Iterator<Item = f32>) -> u32 {
        let at = self.values.len() as u32;
        self.values.extend(values);
        at
    }
}

/// Packs a board. The plane of the board is expressed in the board's own frame.
fn board(printed: &Printed, packed: &mut Packed) {
    let [columns, rows] = printed.board.grid();
    (packed.width, packed.height) = (columns, rows);
    let (lay, radii) = match printed.board {
        Board::Dots {
            dot_mm, marker_mm, ..
        } => (LAY_DOTS, [dot_mm / 2.0, marker_mm / 2.0]),
        Board::Chess { .. } => (LAY_CHESS, [0.0; 2]),
    };
    packed.lay = lay;
    let [dot, marker] = radii;
    packed.mean = printed.board.mean_ink() as f32;
    packed.board = [printed.board.pitch_mm(), dot, marker, printed.ink].map(|v| v as f32);
}

/// Flattens normals into the layout that the shaders expect.
pub(super) fn flat(normals: &[[Vec3; 3]]) -> impl Iterator<Item = f32> {
    normals.iter().flatten().flat_map(|n| n.to_array())
}

/// Returns the number of a mapping mode in `laid.wgsl`.
pub(super) fn number(lay: Lay) -> u32 {
    match lay {
        Lay::Along => LAY_ALONG,
        Lay::Sphere => LAY_SPHERE,
        Lay::Cylinder => LAY_CYLINDER,
    }
}

/// Returns the rows of a pose's 3 x 4 matrix.
fn rows(pose: &Pose) -> [[f32; 4]; 3] {
    let rotation = pose.rotation.transpose();
    std::array::from_fn(|i| {
        let row = rotation.col(i).extend(pose.translation_mm[i]);
        row.as_vec4().to_array()
    })
}

/// Number of entries per unit of the table of `soft.wgsl`, and the argument at which the table ends.
const FINE: usize = 16;
const END: usize = 6;
/// Inverse of the unit in which sums of texels are stored as integers.
const UNITS: f64 = (1u64 << 30) as f64;

/// Returns the table of `soft.wgsl`: H(z), g(z) and Phi(-z) at each entry.
///
/// g(z) = phi(z) - z Phi(-z) is the amount by which blur raises the foot of a ramp, and H(z) is its
/// integral from 0, 1/4 - ((z^2 + 1) Phi(-z) - z phi(z)) / 2.
pub(super) fn soft() -> impl Iterator<Item = f32> {
    (0..=END * FINE).flat_map(|i| {
        let z = i as f64 / FINE as f64;
        let (tail, density) = (distribution(-z), density(z));
        let integral = 0.25 - ((z * z + 1.0) * tail - z * density) / 2.0;
        [integral, density - z * tail, tail].map(|v| v as f32)
    })
}

/// Returns a material with a specular lobe in the layout of `ggx.wgsl`.
pub(super) fn lobe(ggx: &Ggx) -> impl Iterator<Item = f32> {
    let head = [ggx.f0, ggx.alpha, ggx.coupling, 0.0];
    head.into_iter()
        .chain(ggx.reflected.iter().copied())
        .map(|v| v as f32)
}

/// Returns the sums of texels in fixed point, low word first. Differences of the f64 sums are
/// accurate to 2^-28; fixed-point and f64 sums are both exact if all sums are multiples of the unit.
pub(super) fn sums(texture: &Texture) -> impl Iterator<Item = [u32; 2]> {
    texture.sums.iter().map(|&sum| {
        let whole = (sum * UNITS).round() as u64;
        [whole as u32, (whole >> 32) as u32]
    })
}

/// Returns the mean of a whole texture.
pub(super) fn mean(texture: &Texture) -> f32 {
    let texels = (texture.width * texture.height) as f64;
    texture.sums.last().map_or(0.0, |sum| (sum / texels) as f32)
}
