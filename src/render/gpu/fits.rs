//! Detects scenes for which f32 is not precise enough, so that the CPU must render them.

use crate::exposure::{LampShape, Optics};
use crate::scene::{Placed, World};
use glam::DVec2;
use phasmid_geometry::{Lens, Solid};

/// Maximum distance from the camera at which f32 suffices: its rounding error at this distance is
/// half a micrometre.
const FAR_MM: f64 = 10_000.0;
/// Maximum depth of a bounding volume hierarchy that the stack of a ray in `bvh.wgsl` can hold.
const LEVELS: usize = 48;
/// Minimum ratio of a curved surface's radius to its distance; below it normals are off by a
/// thousandth.
const LEAST_RADIUS: f64 = 2e-4;
/// Maximum distance of the principal point from the image centre in pixels; above it f32 has too few
/// digits for image coordinates.
const FARTHEST_AXIS_PX: f64 = 8192.0;
/// Maximum focal length in pixels; above it the rounding of directions is a significant fraction of
/// a pixel.
const LONGEST_PX: f64 = 10_000.0;

/// Checks that f32 precision suffices for a scene.
///
/// # Errors
/// Returns the reason if f32 precision does not suffice.
pub(crate) fn fits(world: &World, optics: &Optics) -> Result<(), String> {
    let far = world.farthest_mm().max(optics.projector.center().length());
    if far > FAR_MM {
        return Err(format!(
            "the scene reaches {:.1} m from the camera: the GPU's 32-bit floats allow {:.0} m",
            far * 1e-3,
            FAR_MM * 1e-3
        ));
    }
    let lens = &optics.camera.lens;
    for lamp in &optics.lamps {
        if let LampShape::Point { at, .. } = lamp.shape
            && at.length() > FAR_MM
        {
            return Err(format!(
                "a lamp is {:.1} m from the camera: the GPU's 32-bit floats allow {:.0} m",
                at.length() * 1e-3,
                FAR_MM * 1e-3
            ));
        }
    }
    let endless = |placed: &&Placed| match placed.solid {
        Solid::Plane { half } => !half.is_finite(),
        _ => false,
    };
    if let Some(placed) = world
        .solids
        .iter()
        .filter(endless)
        .find(|p| world.object_moves(p.object))
    {
        return Err(format!(
            "object[{}], an infinite plane, moves",
            placed.object
        ));
    }
    if world.solids.iter().any(|placed| runs_far(placed, lens)) {
        return Err(format!(
            "an infinite plane is seen more than {:.0} m away",
            FAR_MM * 1e-3
        ));
    }
    for placed in &world.solids {
        let (Solid::Sphere { radius } | Solid::Cylinder { radius, .. }) = placed.solid else {
            continue;
        };
        let away = placed.solid_from_rig.translation_mm.length();
        if radius < LEAST_RADIUS * away {
            return Err(format!(
                "object[{}], of radius {radius:.2e} mm, is too small at {away:.0} mm",
                placed.object
            ));
        }
    }
    for lens in [lens, &optics.projector.lens] {
        let focal = lens.focal_px.max_element();
        if focal > LONGEST_PX {
            return Err(format!("a focal length of {focal:.0} px is too long"));
        }
        let off = lens.principal_px - DVec2::new(lens.width_px.into(), lens.height_px.into()) / 2.0;
        if off.abs().max_element() > FARTHEST_AXIS_PX {
            return Err(format!(
                "a principal point {:.0} px from the image's middle is too far off",
                off.abs().max_element()
            ));
        }
    }
    let levels = world.hierarchies().map(|bvh| bvh.levels()).max();
    match levels {
        Some(levels) if levels > LEVELS => Err(format!(
            "the hierarchy over its triangles has {levels} levels; expected at most {LEVELS}"
        )),
        _ => Ok(()),
    }
}

/// Returns whether an infinite plane is visible far away. Tests the corners of the image, where a
/// visible plane is farthest away.
fn runs_far(placed: &Placed, lens: &Lens) -> bool {
    let Solid::Plane { half } = placed.solid else {
        return false;
    };
    let (w, h) = (f64::from(lens.width_px), f64::from(lens.height_px));
    let corners = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|c| DVec2::from(c) - 0.5);
    let to = &placed.solid_from_rig;
    !half.is_finite()
        && corners.iter().any(|&px| {
            let ray = lens.ray(px);
            let t = -to.translation_mm.z / to.direction(ray).z;
            !(t > 0.0 && (ray * t).length() <= FAR_MM)
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_profile::{Profile, Scene};

    fn why(profile: &Profile, text: &str) -> Option<String> {
        let text = format!("name = \"s\"\ndescription = \"\"\n[[object]]\nalbedo = 0.5\n{text}");
        let scene = Scene::parse(&text, "s").unwrap();
        let optics = Optics::new(profile, &scene);
        let world = World::new(&scene, &optics.skins).unwrap();
        fits(&world, &optics).err()
    }

    #[test]
    fn scenes_beyond_f32_are_refused_with_the_reason() {
        let mut profile = Profile::load("pmp-real").unwrap();
        for name in phasmid_profile::scene_names() {
            let scene = Scene::load(name).unwrap();
            let optics = Optics::new(&profile, &scene);
            let world = World::new(&scene, &optics.skins).unwrap();
            assert_eq!(fits(&world, &optics), Ok(()), "{name}");
        }
        let ball = |z: f64, radius: f64| {
            format!(
                "shape = {{ kind = \"sphere\", radius_mm = {radius} }}\nposition_mm = [0, 0, {z}]"
            )
        };
        assert_eq!(why(&profile, &ball(9000.0, 900.0)), None);
        let told = |text: &str, words: &str| {
            let why = why(&profile, text).unwrap();
            assert!(why.contains(words), "{why}");
        };
        told(&ball(9000.0, 1100.0), "10.1 m from the camera");
        told(&ball(9000.0, 1.0), "too small at 9000 mm");
        let far = "motion = { keyframes = [ { time_s = 0 }, { time_s = 1, position_mm = [0, 0, 9000] } ] }";
        told(&format!("{}\n{far}", ball(2000.0, 50.0)), "from the camera");
        let plane = "shape = { kind = \"plane\" }\nposition_mm = [0, 0, 1000]";
        assert_eq!(why(&profile, plane), None);
        told(
            &format!("{plane}\nrotation_deg = [0, 50, 0]"),
            "an infinite plane",
        );
        let torso =
            "shape = { kind = \"torso\", seed = 1 }\nscale = 60.0\nposition_mm = [0, 0, 1000]";
        told(torso, "from the camera");
        let lamp = "[[light]]\nkind = \"point\"\nintensity_w_sr = 1.0\n";
        let near = format!("{plane}\n{lamp}position_mm = [0, 0, -9000]");
        assert_eq!(why(&profile, &near), None);
        told(&near.replace("-9000", "-11000"), "a lamp is 11.0 m");
        let tilts = "motion = { keyframes = [ { time_s = 0 }, { time_s = 1, rotation_deg = [0, 80, 0] } ] }";
        told(&format!("{plane}\n{tilts}"), "an infinite plane, moves");
        let mut shifted = profile.clone();
        shifted.projector.lens_shift_px[0] = 20_000.0;
        assert!(why(&shifted, plane).unwrap().contains("principal point"));
        profile.camera.focal_length_mm *= 100.0;
        assert!(why(&profile, plane).unwrap().contains("focal length"));
    }
}
