//! Builds a world from a scene's objects.

use super::{Fixed, Placed, World};
use crate::material::{Materials, Smoother};
use crate::scene::animation::{self, Animation, Part};
use crate::scene::closed::outward;
use crate::scene::instance::{Instance, Model};
use crate::scene::shape::{mesh, solid};
use crate::skin::Skins;
use glam::DVec3;
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::raycast::Bvh;
use phasmid_geometry::{Mesh, Solid};
use phasmid_profile::{Object, Scene, Shape};
use std::sync::Arc;

/// Maximum number of triangles of a scene, which take about 10 GiB including their hierarchy.
const MAX_TRIANGLES: usize = 50_000_000;

/// A world under construction.
struct Builder<'a> {
    scene: &'a Scene,
    /// Request that ends the construction early.
    stop: &'a Stop,
    fixed: Fixed,
    solids: Vec<Placed>,
    instances: Vec<Instance>,
    materials: Materials,
}

impl Builder<'_> {
    /// Adds a solid and returns its part.
    fn solid(&mut self, solid: Solid, object: &Object, index: u16) -> Part {
        let pose = self.scene.rig_from_object(object);
        self.solids.push(Placed::new(solid, pose, index));
        Part::Solid(self.solids.len() - 1)
    }

    /// Removes redundant triangles from a mesh that was read from a file, and adds a note about it.
    fn clean(
        &mut self,
        mesh: &mut Mesh,
        keys: &[Vec<DVec3>],
        object: &Object,
        index: u16,
    ) -> Result<()> {
        let Shape::Mesh { file } = &object.shape else {
            return Ok(());
        };
        let place = format!("scene, object[{index}].shape.file");
        let name = self.scene.folder.join(file).display().to_string();
        let removed = mesh
            .clean_deforming(keys, &name)
            .map_err(|e| e.at(&place))?;
        if removed.total() > 0 {
            self.fixed.notes.push(format!("{place}: {name}: {removed}"));
        }
        Ok(())
    }

    fn read(&mut self, object: &Object, index: u16) -> Result<Mesh> {
        let field = match object.shape {
            Shape::Mesh { .. } => "shape.file",
            _ => "shape",
        };
        let place = || format!("scene, object[{index}].{field}");
        self.stop.check()?;
        let mut mesh = mesh(&object.shape, &self.scene.folder).map_err(|e| e.at(place()))?;
        self.stop.check()?;
        // The mesh of a deforming object must first be compared with its keyframes, so it is cleaned
        // later.
        if object.deform.is_none() {
            self.clean(&mut mesh, &[], object, index)?;
        }
        self.stop.check()?;
        let total = self.fixed.owner.len() + mesh.triangles.len();
        if total > MAX_TRIANGLES {
            return Err(Error::input(
                place(),
                format!("{total} triangles with those before it"),
                format!("up to {MAX_TRIANGLES} triangles in a scene"),
            ));
        }
        Ok(mesh)
    }

    /// Adds a static mesh.
    fn mesh(&mut self, object: &Object, index: u16) -> Result<()> {
        let mesh = self.read(object, index)?;
        let pose = self.scene.rig_from_object(object);
        let fixed = &mut self.fixed;
        let first = fixed.vertices.len() as u32;
        let placed = mesh.vertices.iter().map(|&v| pose.point(v * object.scale));
        fixed.vertices.extend(placed);
        let shifted = mesh.triangles.iter().map(|t| t.map(|i| i + first));
        fixed.triangles.extend(shifted);
        let of = fixed.owner.len();
        self.materials
            .mesh(index, of, &mesh, &fixed.vertices, &fixed.triangles[of..])
            .map_err(|e| e.at(format!("scene, object[{index}]")))?;
        fixed.owner.resize(fixed.triangles.len(), index);
        fixed.outward[usize::from(index)] = outward(&mesh.vertices, &mesh.triangles);
        Ok(())
    }

    /// Adds a moving mesh and returns its part.
    fn instance(&mut self, object: &Object, index: u16) -> Result<Part> {
        let mut mesh = self.read(object, index)?;
        let place = || format!("scene, object[{index}]");
        let keys = animation::keys(self.scene, object, &mesh).map_err(|e| e.at(place()))?;
        if object.deform.is_some() {
            self.clean(&mut mesh, &keys, object, index)?;
        }
        self.stop.check()?;
        let rig_from_rest = self.scene.rig_from_object(object);
        let scaled: Vec<DVec3> = mesh.vertices.iter().map(|&v| v * object.scale).collect();
        let placed: Vec<DVec3> = scaled.iter().map(|&v| rig_from_rest.point(v)).collect();
        let first = self.fixed.owner.len();
        self.materials
            .mesh(index, first, &mesh, &placed, &mesh.triangles)
            .map_err(|e| e.at(place()))?;
        self.stop.check()?;
        let shines = object.lobe().is_some() && !keys.is_empty();
        let smoother = shines.then(|| Smoother::new(&scaled, &mesh.triangles));
        self.fixed.owner.resize(first + mesh.triangles.len(), index);
        self.fixed.outward[usize::from(index)] = outward(&mesh.vertices, &mesh.triangles);
        let farthest = |way: &mut dyn Iterator<Item = f64>| way.fold(0.0, f64::max);
        let shapes = std::iter::once(&scaled).chain(&keys);
        let reach = |key: &Vec<DVec3>| {
            let pairs = key.iter().zip(&scaled);
            farthest(&mut pairs.map(|(there, rest)| there.distance(*rest)))
        };
        self.instances.push(Instance::new(Model {
            first: first as u32,
            radius_mm: farthest(&mut shapes.flatten().map(|v| v.length())),
            key_reach_mm: keys.iter().map(reach).collect(),
            triangles: mesh.triangles,
            vertices: scaled,
            rig_from_rest,
            keys,
            smoother,
        }));
        Ok(Part::Instance(self.instances.len() - 1))
    }

    fn path(&mut self, object: &Object, index: u16, part: Part) -> Result<()> {
        if object.moves() {
            let path = Animation::new(self.scene, object, index, part)?;
            self.fixed.paths.push(path);
        }
        Ok(())
    }
}

impl World {
    /// Builds the scene in its state at power-on.
    pub(crate) fn new(scene: &Scene, skins: &Skins) -> Result<Self> {
        Self::with_stop(scene, skins, &Stop::default())
    }

    /// Same as [`Self::new`], but returns [`Error::Interrupted`] once the request `stop` is made.
    /// The request is checked between objects, and between the steps of building one object.
    pub(crate) fn with_stop(scene: &Scene, skins: &Skins, stop: &Stop) -> Result<Self> {
        stop.check()?;
        let mut builder = Builder {
            scene,
            stop,
            fixed: Fixed {
                outward: vec![0.0; scene.object.len()],
                ..Fixed::default()
            },
            solids: Vec::new(),
            instances: Vec::new(),
            materials: Materials::new(scene, skins)?,
        };
        let objects = || scene.object.iter().zip(0u16..);
        for (object, index) in objects() {
            match solid(&object.shape, object.scale) {
                Some(solid) => {
                    let part = builder.solid(solid, object, index);
                    builder.path(object, index, part)?;
                }
                None if object.moves() => {}
                None => builder.mesh(object, index)?,
            }
        }
        // Triangles of moving meshes get numbers after those of all static meshes.
        for (object, index) in objects() {
            if object.moves() && solid(&object.shape, object.scale).is_none() {
                let part = builder.instance(object, index)?;
                builder.path(object, index, part)?;
            }
        }
        stop.check()?;
        let mut fixed = builder.fixed;
        fixed.bvh = Bvh::build(&fixed.vertices, &fixed.triangles);
        fixed.paths.sort_by_key(|path| path.object);
        let mut world = Self {
            fixed: Arc::new(fixed),
            solids: builder.solids,
            instances: builder.instances,
            materials: Arc::new(builder.materials),
        };
        stop.check()?;
        world.set(&world.state(0.0));
        Ok(world)
    }
}
