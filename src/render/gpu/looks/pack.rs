//! Packs the materials of objects into contiguous buffers.

use super::{Deforming, tables};
use crate::body::Body;
use crate::look::{Ggx, Lay, Look, Map, Picture, Place, Printed, Texture};
use crate::world::{Surface, World};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use phasmid_geometry::Board;
use phasmid_geometry::Pose;
use std::sync::Arc;

/// Marks an absent offset.
const NOTHING: u32 = u32::MAX;
/// Texture mapping modes.
const LAY_NONE: u32 = 0;
const LAY_CORNERS: u32 = 1;
pub(super) const LAY_ALONG: u32 = 2;
pub(super) const LAY_SPHERE: u32 = 3;
pub(super) const LAY_CYLINDER: u32 = 4;
pub(super) const LAY_DOTS: u32 = 5;
pub(super) const LAY_CHESS: u32 = 6;

/// Twin of `Look` in `looks.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Packed {
    albedo: f32,
    material: u32,
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

/// Buffers being filled.
pub(super) struct Packer {
    pub(super) looks: Vec<Packed>,
    pub(super) values: Vec<f32>,
    pub(super) sums: Vec<[u32; 2]>,
    pub(super) deforming: Vec<Deforming>,
    /// Already packed data, shared between objects.
    materials: Vec<(Arc<Ggx>, u32)>,
    textures: Vec<(Arc<Texture>, u32)>,
}

impl Packer {
    /// Creates a packer that appends to `values`.
    pub(super) fn new(values: Vec<f32>) -> Self {
        Self {
            looks: Vec::new(),
            values,
            sums: Vec::new(),
            deforming: Vec::new(),
            materials: Vec::new(),
            textures: Vec::new(),
        }
    }

    /// Adds all objects, in all shapes they take on during a rolling-shutter exposure.
    pub(super) fn objects(&mut self, worlds: &[World]) {
        let world = &worlds[0];
        for (object, look) in (0u16..).zip(&world.looks.of) {
            let first = Surface(look.first_triangle as u32);
            let is_mesh = world.is_triangle(first) && world.object(first) == object;
            let bodies = worlds.iter().filter_map(|world| world.body_of(object));
            let bodies: Vec<&Body> = bodies.collect();
            // Solids and moving meshes are kept in their own frames.
            let is_here = is_mesh && bodies.is_empty();
            self.object(object, look, &bodies, is_here);
        }
        if self.looks.is_empty() {
            // A binding must hold at least one element.
            self.looks.push(Packed::zeroed());
        }
    }

    fn object(&mut self, object: u16, look: &Look, bodies: &[&Body], is_here: bool) {
        let mut packed = Packed {
            albedo: look.albedo as f32,
            material: NOTHING,
            first_triangle: look.first_triangle as u32,
            lay: LAY_NONE,
            normals: NOTHING,
            colours: NOTHING,
            coordinates: NOTHING,
            rest: NOTHING,
            ..Packed::zeroed()
        };
        if let Some(ggx) = &look.specular {
            packed.material = self.material(ggx);
        }
        if !look.normals.is_empty() {
            (packed.normals, packed.normals_step) = self.normals(object, look, bodies);
        }
        if !look.colours.is_empty() {
            packed.colours = self.put(look.colours.iter().flatten().copied());
        }
        match &look.map {
            Some(Map::Picture(picture)) => {
                self.picture(picture, bodies.first().copied(), is_here, &mut packed);
            }
            Some(Map::Board(printed)) => board(printed, &mut packed),
            None => {}
        }
        self.looks.push(packed);
    }

    /// Adds smooth normals, for a moving mesh in its own frame. Returns their offset and the stride
    /// between shapes.
    fn normals(&mut self, object: u16, look: &Look, bodies: &[&Body]) -> (u32, u32) {
        let at = self.values.len() as u32;
        let first = bodies.first();
        if first.is_none_or(|body| body.smooth_normals().is_empty()) {
            let rig_from_own = first.map_or(Pose::IDENTITY, |body| body.model().rig_from_rest);
            let turn = rig_from_own.inverse().rotation;
            let own = |n: &Vec3| (turn * n.as_dvec3()).as_vec3().to_array();
            return (self.put(look.normals.iter().flatten().flat_map(own)), 0);
        }
        for (shape, body) in bodies.iter().enumerate() {
            let at = self.put(flat(body.smooth_normals()));
            self.deforming.push(Deforming {
                object,
                shape,
                at,
                blend: body.blend(),
            });
        }
        (at, 9 * look.normals.len() as u32)
    }

    fn picture(
        &mut self,
        picture: &Picture,
        body: Option<&Body>,
        is_here: bool,
        packed: &mut Packed,
    ) {
        let texture = &picture.texture;
        packed.sums = self.texture(texture);
        packed.mean = tables::mean(texture);
        (packed.width, packed.height) = (texture.width as u32, texture.height as u32);
        match &picture.place {
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
                if let Some(body) = body.filter(|body| body.deforming_triangles() > 0) {
                    let model = body.model();
                    let corner = |&i: &u32| model.vertices[i as usize].as_vec3().to_array();
                    packed.rest = self.put(model.triangles.iter().flatten().flat_map(corner));
                }
            }
        }
    }

    fn material(&mut self, ggx: &Arc<Ggx>) -> u32 {
        if let Some((_, at)) = self.materials.iter().find(|(had, _)| Arc::ptr_eq(had, ggx)) {
            return *at;
        }
        let at = self.put(tables::material(ggx));
        self.materials.push((ggx.clone(), at));
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
        self.sums.extend(tables::sums(texture));
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

/// Packs a board, whose plane is kept in its own frame.
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

/// Flattens normals into the layout of the shaders.
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
