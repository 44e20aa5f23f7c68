//! The rig of Wu et al. and the objects in front of it.

use super::formula::{BASE_MM, HEIGHT_MM, TOP_MM};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, Pose, shapes};
use phasmid_profile::{Focus, Profile, RigPlace, Scene, Shape};

/// Projector light in the section on distances, relative to the bench's own and equal at all distances:
/// at full light the top of the trapezoid would saturate at 800 mm.
pub const DIMMED: f64 = 0.7;

/// Returns `pmp-bench` with lenses that are sharp at 1000 mm: the projector has an aperture of 5 mm, as
/// in `pmp-real`, and the camera its own f-number. With `cut`, the camera has only that many columns and
/// rows, from the middle of the sensor of Wu et al., with identical pixels.
///
/// # Errors
/// Returns no error for a built-in profile.
pub fn bench(light: f64, cut: Option<[u32; 2]>) -> Result<Profile> {
    let mut profile = Profile::load("pmp-bench")?;
    let camera = &mut profile.camera;
    camera.focus_mm = Some(1000.0);
    if let Some([width, height]) = cut {
        camera.sensor_width_mm *= f64::from(width) / f64::from(camera.width_px);
        (camera.width_px, camera.height_px) = (width, height);
    }
    let projector = &mut profile.projector;
    projector.focus = Some(Focus {
        distance_mm: 1000.0,
        aperture_mm: 5.0,
    });
    projector.radiant_intensity_w_sr *= light;
    Ok(profile)
}

/// Returns the columns and rows that contain the trapezoid at any distance.
pub fn around_trapezoid(quick: bool) -> Option<[u32; 2]> {
    quick.then_some([240, 193])
}

/// Returns the columns and rows that contain the torso in any view.
pub fn around_torso(quick: bool) -> Option<[u32; 2]> {
    quick.then_some([420, 321])
}

/// Returns the trapezoid on its floor at a distance in mm; the floor is the reference plane.
///
/// # Errors
/// Returns no error for a built-in scene.
pub fn trapezoid(distance_mm: f64) -> Result<Scene> {
    let mut scene = Scene::load("trapezoid")?;
    for object in 0..scene.object.len() {
        scene.place(object, [0.0, 0.0, distance_mm], [0.0; 3])?;
    }
    Ok(scene)
}

/// Returns a scene with only the reference plane at a distance in mm.
///
/// # Errors
/// Returns no error for a built-in scene.
pub fn plane(distance_mm: f64) -> Result<Scene> {
    let mut scene = Scene::load("plane")?;
    scene.place(0, [0.0, 0.0, distance_mm], [0.0; 3])?;
    Ok(scene)
}

/// Direction from which the scanner sees the torso.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// Sees the torso from its left: it is rotated by 45 degrees about its long axis.
    Left,
    /// Sees the torso from its right: it is rotated by 135 degrees about its long axis.
    Right,
    /// Sees the torso from the feet: it is rotated by 45 degrees about the axis across it.
    Feet,
}

/// Middle of the torso, around which the scanner moves, in the scene's frame in mm.
const MIDDLE_MM: DVec3 = DVec3::new(0.0, 0.0, 1040.0);

/// Returns the torso on a table, seen from a direction, at the same distance from its middle as in the
/// view from above. The table is only 530 mm wide, because an endless table would hide the torso.
///
/// # Errors
/// Returns no error for a built-in scene.
pub fn torso(view: View) -> Result<Scene> {
    let mut scene = Scene::load("torso")?;
    // The head lies towards +x and the front towards -z, so the left side is towards +y.
    let rotation_deg = match view {
        View::Left => [45.0, 0.0, 0.0],
        View::Right => [-45.0, 0.0, 0.0],
        View::Feet => [0.0, 45.0, 0.0],
    };
    let turn = Pose::from_xyz_deg(DVec3::ZERO, DVec3::from_array(rotation_deg));
    let place = MIDDLE_MM - turn.direction(DVec3::Z) * MIDDLE_MM.z;
    scene.rig = RigPlace {
        position_mm: place.to_array(),
        rotation_deg,
    };
    if let Some(table) = scene.object.first_mut() {
        table.shape = Shape::Plane {
            size_mm: Some([2000.0, 530.0]),
        };
    }
    Ok(scene)
}

/// Returns the surface of a scene's last object (trapezoid or torso) in the rig's frame.
///
/// # Errors
/// Returns an error for any other object.
pub fn surface(scene: &Scene) -> Result<Mesh> {
    let wrong = || {
        Error::device(format!(
            "scene {}: the last object is neither a trapezoid nor a torso",
            scene.name
        ))
    };
    let object = scene.object.last().ok_or_else(wrong)?;
    let mut mesh = match object.shape {
        Shape::Frustum { .. } => frustum(),
        Shape::Torso {
            seed,
            length_mm,
            width_mm,
            depth_mm,
            triangles,
        } => shapes::torso(&shapes::Torso {
            seed,
            length_mm,
            width_mm,
            depth_mm,
            triangles,
        }),
        _ => return Err(wrong()),
    };
    let rig_from_object = scene.rig_from_object(object);
    for vertex in &mut mesh.vertices {
        *vertex = rig_from_object.point(*vertex * object.scale);
    }
    Ok(mesh)
}

/// Returns the trapezoid: ten triangles and its base.
fn frustum() -> Mesh {
    let ring = |side: f64, z: f64| {
        let half = side / 2.0;
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| DVec3::new(x * half, y * half, z))
    };
    let vertices = [ring(BASE_MM, 0.0), ring(TOP_MM, -HEIGHT_MM)].concat();
    let mut triangles = vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]];
    for i in 0..4 {
        let next = (i + 1) % 4;
        triangles.extend([[i, i + 4, next + 4], [i, next + 4, next]]);
    }
    Mesh {
        vertices,
        triangles,
        ..Mesh::default()
    }
}

/// Returns the pose that maps points of the rig's frame to the frame of a scene's last object, in mm.
pub fn of_object(scene: &Scene) -> Pose {
    scene.object.last().map_or(Pose::IDENTITY, |object| {
        scene.rig_from_object(object).inverse()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_geometry::MeshTree;

    #[test]
    fn a_camera_that_is_cut_sees_the_same() {
        let [whole, cut] = [None, around_trapezoid(true)].map(|cut| bench(1.0, cut).unwrap());
        let [a, b] = [whole, cut].map(|profile| profile.nominal_rig().camera.lens);
        assert!((a.focal_px - b.focal_px).length() < 1e-9);
        // The cut is shifted by a whole number of pixels.
        let off = a.principal_px - b.principal_px;
        assert_eq!(off, off.round());
    }

    #[test]
    fn views_look_at_the_middle_from_the_side_they_are_named_for() {
        let left = DVec3::Y;
        for (view, side) in [
            (View::Left, left),
            (View::Right, -left),
            (View::Feet, -DVec3::X),
        ] {
            let scene = torso(view).unwrap();
            let camera = DVec3::from_array(scene.rig.position_mm);
            let away = (camera - MIDDLE_MM).normalize();
            let half = std::f64::consts::FRAC_1_SQRT_2;
            assert!((away.dot(side) - half).abs() < 1e-12, "{view:?} {away}");
            assert!((away.dot(-DVec3::Z) - half).abs() < 1e-12, "{view:?}");
            let seen = scene.rig_from_scene().point(MIDDLE_MM);
            assert!(
                (seen - DVec3::Z * 1040.0).length() < 1e-9,
                "{view:?} {seen}"
            );
        }
    }

    #[test]
    fn the_surfaces_are_where_the_objects_are() {
        let scene = trapezoid(900.0).unwrap();
        let tree = MeshTree::new(&surface(&scene).unwrap());
        for (p, distance) in [
            (DVec3::new(10.0, -20.0, 820.0), 0.0),
            (DVec3::new(75.0, 0.0, 860.0), 0.0),
            (DVec3::new(0.0, 0.0, 800.0), 20.0),
        ] {
            let found = tree.closest(p).unwrap().distance_mm;
            assert!((found - distance).abs() < 1e-9, "{p}: {found}");
        }
    }
}
