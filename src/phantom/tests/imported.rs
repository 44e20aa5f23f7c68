//! Re-imports a phantom's exported files.

use super::*;
use phasmid_planning::import::Import;
use phasmid_planning::isosurface::SKIN_HU;
use phasmid_planning::metaimage::{read_field, read_volume};
use phasmid_planning::planning::fit::closed;
use phasmid_planning::planning::{Planning, PlanningFile};
use std::path::Path;

/// Returns the import of a planning folder's files, with the reference phase at 50 %.
fn of_planning(folder: &Path) -> Import {
    let file = PlanningFile::read(folder).unwrap();
    Import {
        name: "again".to_owned(),
        ct: folder.join("ct_50.mha"),
        skin_hu: SKIN_HU,
        tumour: folder.join("tumour.ply"),
        isocentre_mm: None,
        reference_percent: 50.0,
        phases: (file.phase.iter())
            .map(|phase| (phase.percent, folder.join(&phase.field)))
            .collect(),
        spacing_mm: None,
        with_ct: false,
        force: false,
    }
}

#[test]
fn exported_planning_is_imported_unchanged() {
    let dir = tempfile::tempdir().unwrap();
    let [from, to, about] = ["from", "to", "about"].map(|name| dir.path().join(name));
    let phantom = Phantom::new(&Patient::load("p07-child").unwrap());
    let spacing_mm = 10.0;
    phantom
        .export_planning(&from, spacing_mm, true, false)
        .unwrap();
    let planned = Planning::load(&from).unwrap();

    let mut import = of_planning(&from);
    import.isocentre_mm = Some(DVec3::ZERO);
    import.with_ct = true;
    let made = import.write(&to, &|_| ()).unwrap();
    let again = Planning::load(&to).unwrap();
    assert_eq!(
        (again.name.as_str(), again.reference_percent),
        ("again", 50.0)
    );
    assert_eq!(again.tumour, planned.tumour);
    assert_eq!(again.phases, planned.phases);
    let [a, b] = [&from, &to].map(|folder| read_volume(&folder.join("ct_50.mha")).unwrap());
    assert_eq!(a, b);
    // Compare the skin without its flat ends; its accuracy in a CT is tested in `planned`.
    for v in again
        .skin
        .vertices
        .iter()
        .filter(|v| (-200.0..150.0).contains(&v.z))
    {
        let off = phantom.outside_skin(*v) / spacing_mm;
        assert!(off.abs() < 1.0 / 6.0, "{v}: {off} voxels");
    }
    assert_eq!(made.skin_triangles, again.skin.triangles.len());
    let ball = std::f64::consts::PI / 6.0 * phantom.patient().tumour.diameter_mm.powi(3);
    assert!(
        (made.tumour_mm3 / ball - 1.0).abs() < 0.01,
        "{}",
        made.tumour_mm3
    );
    let gone = |tenth: usize| phantom.displacement(DVec3::ZERO, &phantom.planning_phase(tenth));
    let farthest = (0..10).map(|k| gone(k).length()).fold(0.0, f64::max);
    let off = made.tumour_motion_mm - farthest;
    assert!(off.abs() < 0.1 * farthest, "{off} of {farthest}");
    assert!(made.skin_motion_mm > 1.0, "{}", made.skin_motion_mm);

    // If the reference phase has no field, its displacement is zero; the isocentre defaults to the
    // tumour's centroid.
    let mut import = of_planning(&from);
    import.phases.retain(|(percent, _)| *percent != 50.0);
    import.phases.reverse();
    let made = import.write(&about, &|_| ()).unwrap();
    assert!(made.file.isocentre_mm.length() < 0.05, "{:?}", made.file);
    assert_eq!(made.file.ct, None);
    let percents: Vec<f64> = made.file.phase.iter().map(|p| p.percent).collect();
    assert_eq!(
        percents,
        [0, 10, 20, 30, 40, 50, 60, 70, 80, 90].map(f64::from)
    );
    let rested = read_field(&about.join("dvf_50.mha")).unwrap();
    assert_eq!(rested.longest_mm(), 0.0);
    let moved = Planning::load(&about).unwrap();
    let middle = closed(&moved.tumour, "tumour").unwrap().centroid_mm;
    assert!(middle.length() < 1e-9, "{middle}");
}
