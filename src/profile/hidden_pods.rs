//! Tests which pods of the built-in ceiling station the linac head hides from the isocentre.

use super::{Configuration, Profile};
use glam::{DVec3, Vec3};
use phasmid_geometry::Pose;
use phasmid_geometry::raycast::{Bvh, LANES, Packet, Scratch};
use phasmid_geometry::shapes::linac_head;

/// Returns whether the linac head at a gantry angle in degrees blocks the line from the isocentre
/// to `place` (mm).
fn hides(gantry_deg: f64, place: DVec3) -> bool {
    let gantry = Pose::from_xyz_deg(DVec3::ZERO, DVec3::new(0.0, gantry_deg, 0.0));
    let mesh = linac_head();
    let vertices: Vec<DVec3> = mesh.vertices.iter().map(|v| gantry.point(*v)).collect();
    let bvh = Bvh::build(&vertices, &mesh.triangles);
    let mut ends = [-1.0; LANES];
    ends[0] = 1.0;
    let mut packet = Packet::new(Vec3::ZERO, &[place.as_vec3(); LANES], &ends);
    bvh.blocked(&mut packet, &mut Scratch::default());
    packet.t[0] < 0.0
}

#[test]
fn pods_are_hidden_from_the_isocentre_at_some_gantry_angles() {
    let Configuration::Station(station) = Configuration::load("sgrt-ceiling").unwrap() else {
        panic!("no station");
    };
    // Left, right and foot pod, in the station's order.
    for (gantry_deg, hidden) in [
        (0.0, [false, false, false]),
        (40.0, [false, true, false]),
        (320.0, [true, false, false]),
        (90.0, [false, false, false]),
        (180.0, [false, false, false]),
        (270.0, [false, false, false]),
    ] {
        for (device, hidden) in station.device.iter().zip(hidden) {
            let place = device.rig().unwrap();
            let camera = DVec3::from_array(place.position_mm);
            assert_eq!(
                hides(gantry_deg, camera),
                hidden,
                "{} at {gantry_deg} degrees",
                device.name
            );
            // If the camera is hidden, the projector next to it is too.
            let profile = Profile::load(&station.profile(device)).unwrap();
            let room_from_rig = Pose::from_xyz_deg(camera, DVec3::from_array(place.rotation_deg));
            let projector = DVec3::from_array(profile.projector.position_mm);
            if hidden {
                assert!(hides(gantry_deg, room_from_rig.point(projector)));
            }
        }
    }
}
