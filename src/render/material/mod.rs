//! Materials of a scene's objects. [`transport`](super::transport) applies them to the points that
//! rays hit.
//!
//! | module | contents |
//! | --- | --- |
//! | `ggx` | specular lobe over a diffuse base |
//! | `map` | spatially varying albedo: texture or board |
//! | `texture` | averages of a texture over footprints |
//! | `lay` | mapping of a texture onto a shape |
//! | `normals` | smooth normals of meshes |
//! | `spot` | the footprint of a pixel on a surface, and barycentric weights |

mod ggx;
mod lay;
mod map;
mod normals;
mod spot;
mod texture;

use super::skin::Skins;
use super::{Plan, Term};
pub(super) use ggx::Ggx;
use glam::{DVec3, Vec3};
pub(super) use lay::Lay;
pub(super) use map::{ImageMap, Map, Place, Printed};
pub(super) use normals::{COS_CREASE, Smoother};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use phasmid_profile::{Object, Scene, Shape, Specular};
pub(super) use spot::{Spot, barycentric};
use std::path::PathBuf;
use std::sync::Arc;
pub(super) use texture::{Texture, texels};

/// Materials of all objects.
pub(super) struct Materials {
    pub(super) of: Vec<Material>,
}

pub(super) struct Material {
    pub(super) albedo: f64,
    pub(super) specular: Option<Arc<Ggx>>,
    /// Whether the scene uses the vertex colours of the object's mesh.
    wants_colours: bool,
    pub(super) map: Option<Map>,
    /// Number, among all triangles of the world, of the object's first triangle.
    pub(super) first_triangle: usize,
    /// Smooth normals at the corners of the object's triangles; empty if not needed.
    pub(super) normals: Vec<[Vec3; 3]>,
    /// Reflectances at the corners of the object's triangles; empty if all are 1.
    pub(super) colours: Vec<[f32; 3]>,
}

/// Resources that several objects may share, cached while materials are created.
#[derive(Default)]
struct Made {
    lobes: Vec<(Specular, Arc<Ggx>)>,
    textures: Vec<(PathBuf, Arc<Texture>)>,
}

impl Materials {
    /// Creates the materials of a scene's objects; mesh data is added by [`Self::mesh`].
    ///
    /// # Errors
    /// Returns an error if a texture cannot be read.
    pub(super) fn new(scene: &Scene, skins: &Skins) -> Result<Self> {
        let mut made = Made::default();
        let material = |(i, object): (usize, &Object)| {
            let map = match (&object.texture, &object.shape) {
                (None, &Shape::Board { board, ink }) => Some(Map::board(board, ink, scene, object)),
                (None, _) => None,
                (Some(file), _) => {
                    let place = || format!("scene, object[{i}].texture");
                    let read = made.texture(scene.folder.join(file));
                    Some(Map::image(read.map_err(|e| e.at(place()))?, scene, object))
                }
            };
            Ok(Material {
                // On skin the albedo scales the reflectance of the tissue.
                albedo: object.albedo * skins.reflectance(i).unwrap_or(1.0),
                specular: object.lobe().map(|specular| made.lobe(specular)),
                wants_colours: object.vertex_colours,
                map,
                first_triangle: 0,
                normals: Vec::new(),
                colours: Vec::new(),
            })
        };
        let of = scene.object.iter().enumerate().map(material);
        Ok(Self {
            of: of.collect::<Result<_>>()?,
        })
    }

    /// Stores the material data of an object's mesh. `vertices` are in the rig's frame with the
    /// object at rest; `first` is the number of the object's first triangle.
    ///
    /// # Errors
    /// Returns an error if the mesh lacks colours or texture coordinates that the scene requires.
    pub(super) fn mesh(
        &mut self,
        object: u16,
        first_triangle: usize,
        mesh: &Mesh,
        vertices: &[DVec3],
        triangles: &[[u32; 3]],
    ) -> Result<()> {
        let material = &mut self.of[usize::from(object)];
        material.first_triangle = first_triangle;
        if material.specular.is_some() {
            material.normals = Smoother::new(vertices, triangles).normals(vertices, triangles);
        }
        if material.wants_colours {
            if mesh.colours.is_empty() {
                return Err(Error::input(
                    "vertex_colours",
                    "a mesh without colours",
                    "a PLY file with red, green and blue, or an OBJ file with `v x y z r g b`",
                ));
            }
            let at = |t: &[u32; 3]| t.map(|i| mesh.colours[i as usize]);
            material.colours = mesh.triangles.iter().map(at).collect();
        }
        match &mut material.map {
            Some(map) => map.take(mesh),
            None => Ok(()),
        }
    }

    /// Returns the albedo for the initial shading: the albedo of the object, or 1 (white) if
    /// [`transport`](super::transport) applies the albedo later.
    #[inline(always)]
    pub(super) fn first_albedo(&self, plan: &Plan, object: u16) -> f64 {
        let material = &self.of[usize::from(object)];
        if material.is_finished_by_apply(plan) {
            1.0
        } else {
            material.albedo
        }
    }

    pub(super) fn any_specular(&self) -> bool {
        self.of.iter().any(|material| material.specular.is_some())
    }

    /// Returns whether an object's albedo varies over its surface.
    pub(super) fn vary(&self, object: u16) -> bool {
        self.of[usize::from(object)].varies()
    }

    /// Returns the number of objects.
    pub(super) fn len(&self) -> usize {
        self.of.len()
    }

    pub(super) fn any_map(&self) -> bool {
        self.of.iter().any(Material::varies)
    }
}

impl Made {
    fn lobe(&mut self, wanted: Specular) -> Arc<Ggx> {
        if let Some((_, ggx)) = self.lobes.iter().find(|(had, _)| *had == wanted) {
            return ggx.clone();
        }
        let ggx = Arc::new(Ggx::new(wanted.f0, wanted.roughness));
        self.lobes.push((wanted, ggx.clone()));
        ggx
    }

    fn texture(&mut self, path: PathBuf) -> Result<Arc<Texture>> {
        if let Some((_, texture)) = self.textures.iter().find(|(had, _)| *had == path) {
            return Ok(texture.clone());
        }
        let texture = Arc::new(Texture::read(&path)?);
        self.textures.push((path, texture.clone()));
        Ok(texture)
    }
}

impl Material {
    /// Returns whether the material's albedo varies over the surface.
    pub(super) fn varies(&self) -> bool {
        self.map.is_some() || self.wants_colours
    }

    pub(super) fn is_finished_by_apply(&self, plan: &Plan) -> bool {
        plan.has(Term::Specular) && self.specular.is_some()
            || plan.has(Term::AlbedoMaps) && self.varies()
    }
}
