//! Tests the exported CT and planning folder.

use super::*;
use phasmid_geometry::shapes::check::closed;
use phasmid_planning::isosurface::{Parts, SKIN_HU, isosurface};
use phasmid_planning::planning::{Folder, PlanningFile};

#[test]
fn a_ct_shows_air_skin_lung_and_tumour() {
    let phantom = one("p02-man-mean");
    for state in [State::REFERENCE, phantom.state(Day::Treatment, 3.0)] {
        let at = |x: DVec3| phantom.hounsfield(phantom.place(x, &state), &state);
        assert_eq!(at(DVec3::new(0.0, -400.0, 0.0)), -1000.0);
        assert!((at(DVec3::ZERO) - 38.0).abs() < 1e-9, "tumour");
        let skin = phantom.skin(3000).unwrap();
        for v in skin.vertices.iter().step_by(41) {
            assert!((at(*v) + 500.0).abs() < 1e-3, "{v}: {}", at(*v));
        }
        let beside = DVec3::new(0.0, 0.0, -45.0);
        assert!(phantom.lobe(beside).is_some());
        let lung = at(beside);
        assert!((-900.0..-650.0).contains(&lung), "{lung}");
    }
    // Inhaling lowers the lung's density.
    let beside = DVec3::new(0.0, 0.0, -45.0);
    let [out, in_] = [5, 0].map(|tenth| {
        let state = phantom.planning_phase(tenth);
        phantom.hounsfield(phantom.place(beside, &state), &state)
    });
    assert!((out + 750.0).abs() < 1e-9 && in_ < out - 5.0, "{out} {in_}");
}

#[test]
fn exported_planning_matches_the_phantom() {
    let dir = tempfile::tempdir().unwrap();
    let phantom = one("p07-child");
    let folder = dir.path().join("plan");
    phantom.export_planning(&folder, 12.0, true, false).unwrap();
    let skin = Mesh::read(&folder.join("skin.ply")).unwrap();
    assert_eq!(skin, phantom.skin(SKIN_TRIANGLES).unwrap());
    closed(&Mesh::read(&folder.join("tumour.ply")).unwrap());
    let plan = PlanningFile::read(&folder).unwrap();
    assert_eq!(
        (plan.name.as_str(), plan.reference_phase),
        ("p07-child", 50.0)
    );
    assert_eq!(
        (plan.phase.len(), plan.ct.as_deref()),
        (PHASES, Some("ct_50.mha"))
    );
    Folder::open(&folder).unwrap();

    let bytes = std::fs::read(folder.join("dvf_10.mha")).unwrap();
    let mark = b"ElementDataFile = LOCAL\n";
    let start = bytes.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len();
    let header = String::from_utf8(bytes[..start].to_vec()).unwrap();
    let field = |name: &str| -> Vec<f64> {
        let line = header.lines().find(|l| l.starts_with(name)).unwrap();
        let values = line.split(" = ").nth(1).unwrap();
        values.split(' ').map(|v| v.parse().unwrap()).collect()
    };
    let size: Vec<usize> = field("DimSize").iter().map(|&n| n as usize).collect();
    let voxels = size.iter().product::<usize>();
    assert_eq!(bytes.len(), start + 12 * voxels);
    let origin = DVec3::from_slice(&field("Offset"));
    let state = phantom.planning_phase(1);
    for index in (0..voxels).step_by(97) {
        let [i, j, k] = [
            index % size[0],
            index / size[0] % size[1],
            index / size[0] / size[1],
        ];
        let x = origin + 12.0 * DVec3::new(i as f64, j as f64, k as f64);
        let wanted = phantom.displacement(x, &state);
        let at = start + 12 * index;
        let number = |c: usize| {
            f64::from(f32::from_le_bytes(
                bytes[at + 4 * c..][..4].try_into().unwrap(),
            ))
        };
        let found = DVec3::new(number(0), number(1), number(2));
        assert!((found - wanted).length() < 1e-5, "{index}");
    }
    let ct = std::fs::read(folder.join("ct_50.mha")).unwrap();
    assert!(ct.len() > 2 * voxels);
    let words = phantom
        .export_planning(&folder, 0.1, false, false)
        .unwrap_err()
        .to_string();
    assert!(words.contains("0.1; expected 1 to 20"), "{words}");
    assert!(phantom.skin(10).is_err());
}

/// A CT with partial volumes shows the skin at any voxel size. Between air (-1000) and fat (-100)
/// the level -500 is 5/9 of the way, so a plane is off by at most 3/2 - 2 sqrt(4/9) voxels (see the
/// iso-surface tests for the theory); for skin over fat, -525 is about half-way.
#[test]
fn the_skin_is_found_in_the_ct() {
    for (name, spacing_mm) in [("p07-child", 10.0), ("p02-man-mean", 16.0)] {
        let dir = tempfile::tempdir().unwrap();
        let phantom = one(name);
        phantom
            .export_planning(dir.path(), spacing_mm, true, false)
            .unwrap();
        let ct = Folder::open(dir.path()).unwrap().ct().unwrap().unwrap();
        for (level, most_beyond, most) in [(SKIN_HU, 0.15, 1.0 / 6.0), (-525.0, 0.01, 0.15)] {
            let skin = isosurface(&ct, level, Parts::LargestFilled, "ct").unwrap();
            let off = off_skin(&phantom, &skin, spacing_mm);
            let count = off.len() as f64;
            let worst = off.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
            let rms = (off.iter().map(|x| x * x).sum::<f64>() / count).sqrt();
            let beyond = off.iter().filter(|x| x.abs() > 0.1).count() as f64 / count;
            let words = format!("{name} at {level}: {rms} RMS, {worst} at worst, {beyond} beyond");
            assert!(count > 2000.0 && worst < most && rms < 0.06, "{words}");
            assert!(beyond < most_beyond, "{words}");
        }
    }
}

/// Returns the distances of vertices from the skin in voxels. The tenth of the body at each end is left
/// out, because the body is cut off with edges that voxels do not resolve.
fn off_skin(phantom: &Phantom, found: &Mesh, spacing_mm: f64) -> Vec<f64> {
    let (low, high) = phantom.skin(6000).unwrap().bounds().unwrap();
    let between = |v: &&DVec3| (0.1..0.9).contains(&((v.z - low.z) / (high.z - low.z)));
    let off = |v: &DVec3| phantom.outside_skin(*v) / spacing_mm;
    found.vertices.iter().filter(between).map(off).collect()
}
