//! Possible occluders of the projector's light: their smallest depth over a grid of directions.
//! Points in front of this depth need no shadow ray.
//!
//! Only half of the triangles of a closed mesh have to be kept. If the camera, the projector and a
//! point that the camera sees lie on the same side of every closed surface, a ray from the projector
//! to the point leaves the mesh as often as it enters it. A ray that hits the mesh at all therefore
//! hits a triangle through which it leaves. These triangles lie behind the lit ones, so few lit
//! points need a shadow ray.

use super::hits::Surface;
use super::tree::{Frame, Points, Tree};
use super::world::World;
use glam::{DVec2, DVec3};
use phasmid_geometry::raycast::{LANES, Scratch};
use phasmid_geometry::{Pose, View};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Number of directions along each side of the grid.
const SIDE: usize = 256;
/// Amount by which the extent of a triangle on the grid is widened, to cover the rounding of its
/// corners.
const WIDER: f64 = 1e-9;
/// Factor that moves depths towards the projector, to cover their rounding to f32.
const NEARER: f64 = 1.0 - 1e-6;
/// Number of triangles per parallel task.
const BLOCK: usize = 8192;

/// For each direction, the depth in the projector's frame in front of which nothing can be shaded.
pub(crate) struct Occluders {
    projector_from_rig: Pose,
    /// Number of grid cells per unit of x/z and y/z.
    scale: DVec2,
    /// Smallest depth in each cell, as the bits of an f32: positive floats have the same order as
    /// their bits.
    depths: Vec<AtomicU32>,
    /// Whether camera and projector lie on the same side of every closed surface.
    joined: bool,
}

impl Occluders {
    /// Finds the possible occluders of points that are seen by a camera at the rig's origin.
    pub(crate) fn new(world: &World, projector: &View) -> Self {
        let lens = &projector.lens;
        let field = DVec2::new(lens.width_px.into(), lens.height_px.into()) / lens.focal_px;
        let infinite = || AtomicU32::new(f32::INFINITY.to_bits());
        let found = Self {
            projector_from_rig: projector.rig_from_view.inverse(),
            scale: SIDE as f64 / (1.1 * field),
            depths: (0..SIDE * SIDE).map(|_| infinite()).collect(),
            joined: joined(world, projector.center()),
        };
        if let Some(tree) = world.still() {
            found.add_mesh(world, &tree);
        }
        for instance in &world.instances {
            found.add_mesh(world, &instance.tree());
        }
        for placed in &world.solids {
            // Solids are convex. If the camera is inside the solid, or if the solid is an infinite
            // plane with camera and projector on the same side, the solid shades no point that the
            // camera sees.
            if !(found.joined && (placed.around_camera || placed.halves_space())) {
                let (center, radius) = placed.ball();
                found.add_ball(found.projector_from_rig.point(center), radius);
            }
        }
        found
    }

    /// Returns `true` if nothing shades a point that the camera sees, given in the rig's frame;
    /// returns `false` if something may shade it.
    pub(crate) fn leave_lit(&self, point: DVec3) -> bool {
        let p = self.projector_from_rig.point(point);
        let [column, row] = self.cell(p.truncate() / p.z);
        p.z > 0.0 && p.z <= f64::from(self.depth(row * SIDE + column))
    }

    fn depth(&self, cell: usize) -> f32 {
        f32::from_bits(self.depths[cell].load(Relaxed))
    }

    /// Returns the column and row of the grid cell of a direction (x/z, y/z). Directions outside the
    /// grid share the cells at its border.
    fn cell(&self, direction: DVec2) -> [usize; 2] {
        let place = direction * self.scale + (SIDE / 2) as f64;
        place.to_array().map(|at| (at as usize).min(SIDE - 1))
    }

    fn add(&self, low: DVec2, high: DVec2, depth: f64) {
        let wider = WIDER * (1.0 + low.abs().max(high.abs()));
        let ([left, top], [right, bottom]) = (self.cell(low - wider), self.cell(high + wider));
        let bits = ((depth * NEARER).max(0.0) as f32).to_bits();
        for row in top..=bottom {
            for cell in &self.depths[row * SIDE + left..=row * SIDE + right] {
                if bits < cell.load(Relaxed) {
                    cell.fetch_min(bits, Relaxed);
                }
            }
        }
    }

    fn add_everywhere(&self, depth: f64) {
        self.add(DVec2::NEG_INFINITY, DVec2::INFINITY, depth);
    }

    fn add_mesh<F: Frame + Sync>(&self, world: &World, tree: &Tree<'_, F>) {
        let place = |v: &DVec3| self.projector_from_rig.point(tree.frame.vertex(*v));
        let vertices: Vec<DVec3> = tree.vertices.par_iter().map(place).collect();
        let blocks = tree.triangles.par_chunks(BLOCK).enumerate();
        blocks.for_each(|(block, triangles)| {
            for (k, triangle) in triangles.iter().enumerate() {
                let surface = Surface(tree.first + (block * BLOCK + k) as u32);
                let outward = match self.joined {
                    true => world.outward(surface),
                    false => 0.0,
                };
                self.add_triangle(triangle.map(|i| vertices[i as usize]), outward);
            }
        });
    }

    /// Adds a triangle of a mesh, which is closed if `outward` is not 0; see [`World::outward`].
    fn add_triangle(&self, [a, b, c]: [DVec3; 3], outward: f64) {
        let nearest = a.z.min(b.z).min(c.z);
        if a.z.max(b.z).max(c.z) <= 0.0 {
            return;
        }
        if outward != 0.0 {
            // The volume is positive if a ray from the projector leaves the mesh through the
            // triangle.
            let across = b.cross(c);
            let volume = outward * a.dot(across);
            let edge_on = 1e-12 * a.abs().max_element() * across.abs().max_element();
            if volume < -edge_on {
                return;
            }
        }
        if nearest <= 0.0 {
            return self.add_everywhere(0.0);
        }
        let [a, b, c] = [a, b, c].map(|p| p.truncate() / p.z);
        self.add(a.min(b).min(c), a.max(b).max(c), nearest);
    }

    /// Adds a ball as an occluder.
    fn add_ball(&self, center: DVec3, radius: f64) {
        let near = center.z - radius;
        if center.z + radius <= 0.0 {
            return;
        }
        if !(near > 0.0) {
            return self.add_everywhere(0.0);
        }
        let far = center.z + radius;
        let (low, high) = (center.truncate() - radius, center.truncate() + radius);
        self.add(
            (low / near).min(low / far),
            (high / near).max(high / far),
            near,
        );
    }
}

/// Returns whether no surface lies between the projector and a camera at the rig's origin.
fn joined(world: &World, projector: DVec3) -> bool {
    let mut points: Points = [None; LANES];
    points[0] = Some((DVec3::ZERO, Surface::NONE));
    projector != DVec3::ZERO && !world.blocked(projector, &points, &mut Scratch::default())[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skin::Skins;
    use phasmid_profile::{Profile, Scene};

    /// Counts the points in the projector's field that the camera of `webcam-grey` sees: all points,
    /// points that need no shadow ray, and points in shadow. Fails if a point in shadow is among the
    /// points that need no shadow ray.
    fn counts(objects: &str, time_s: f64) -> [usize; 3] {
        let text = format!("name = \"s\"\ndescription = \"\"\n{objects}");
        let scene = Scene::parse(&text, "test").unwrap();
        let profile = Profile::load("webcam-grey").unwrap();
        let mut world = World::new(&scene, &Skins::new(&profile, &scene)).unwrap();
        world.set(&world.state(time_s * 1e9));
        let projector = profile.projector.view();
        let occluders = Occluders::new(&world, &projector);
        let in_field = |point: DVec3| {
            projector
                .project(point)
                .is_some_and(|px: DVec2| projector.lens.contains(px))
        };
        let mut scratch = Scratch::default();
        let mut counts = [0; 3];
        for (row, tile) in (0..160).flat_map(|row| (0..12).map(move |tile| (row, tile))) {
            let directions = std::array::from_fn(|lane| {
                let column = (tile * LANES + lane) as f64;
                DVec3::new(column / 96.0 - 1.0, f64::from(row) / 96.0 - 0.83, 1.0) * 0.45
                    + DVec3::Z * 0.55
            });
            let used = [true; LANES];
            let hits = world.nearest(DVec3::ZERO, &directions, &used, &mut scratch);
            let points: Points = std::array::from_fn(|lane| {
                let point = directions[lane] * hits.t[lane];
                let normal = hits.normal(lane);
                let faces = normal.dot(projector.center() - point) > 0.0;
                let seen = hits.is_hit(lane) && faces && in_field(point);
                seen.then_some((point, hits.surface[lane]))
            });
            let blocked = world.blocked(projector.center(), &points, &mut scratch);
            for (point, blocked) in points.iter().zip(blocked) {
                let Some((point, _)) = point else { continue };
                let clear = occluders.leave_lit(*point);
                assert!(!(clear && blocked), "{point} of {objects}");
                counts[0] += 1;
                counts[1] += usize::from(clear);
                counts[2] += usize::from(blocked);
            }
        }
        println!("{counts:?} of {objects}");
        counts
    }

    const WALL: &str =
        "[[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1300]\nalbedo = 0.5\n";

    fn object(shape: &str, position: [f64; 3], more: &str) -> String {
        format!("[[object]]\nshape = {shape}\nposition_mm = {position:?}\nalbedo = 0.5\n{more}\n")
    }

    const TORSO: &str = "{ kind = \"torso\", triangles = 20000 }";
    const BALL: &str = "{ kind = \"sphere\", radius_mm = 60.0 }";

    #[test]
    fn points_that_need_no_shadow_ray_are_lit_and_most_need_none() {
        let rod = "{ kind = \"cylinder\", radius_mm = 4.0, length_mm = 500.0 }";
        let moves = "rotation_deg = [0, 20, 0]\nmotion = { period_s = 4.0, keyframes = [\
            { time_s = 0.0 }, { time_s = 1.0, position_mm = [30, 0, -40] }] }";
        let torso = |z: f64, more: &str| object(TORSO, [0.0, 0.0, z], more);
        let room = object("{ kind = \"sphere\", radius_mm = 3000.0 }", [0.0; 3], "");
        for (scene, least, shaded) in [
            (WALL.to_owned(), 0.99, 0),
            (format!("{WALL}{}", torso(1000.0, "")), 0.65, 100),
            (format!("{WALL}{}", torso(1000.0, moves)), 0.65, 100),
            (
                format!("{WALL}{}", object(BALL, [-60.0, 0.0, 900.0], "")),
                0.6,
                100,
            ),
            (
                format!("{WALL}{}", object(rod, [-30.0, 0.0, 800.0], "")),
                0.1,
                10,
            ),
            (
                format!(
                    "{room}{}{}",
                    torso(1000.0, ""),
                    object(BALL, [-90.0, 0.0, 700.0], "")
                ),
                0.3,
                100,
            ),
        ] {
            let [seen, clear, blocked] = counts(&scene, 0.7);
            assert!(seen > 10_000, "{seen} of {scene}");
            assert!(
                clear as f64 >= least * seen as f64,
                "{clear} of {seen}: {scene}"
            );
            assert!(blocked >= shaded, "{blocked} of {scene}");
        }
    }

    /// With a torso between camera and projector, all triangles of closed meshes are kept as
    /// occluders.
    #[test]
    fn a_projector_behind_an_object_has_every_triangle_as_occluder() {
        let small = "{ kind = \"torso\", triangles = 5000 }";
        for x in [-300.0, -200.0, -100.0, -50.0, 50.0, 100.0, 200.0] {
            counts(
                &format!("{WALL}{}", object(small, [x, 0.0, 60.0], "scale = 0.3")),
                0.0,
            );
        }
    }
}
