//! Tests a valid planning folder, and a folder with each kind of error.

use super::*;
use crate::isosurface::{Parts, isosurface};
use crate::metaimage::{write_field, write_volume};
use crate::volume::{Grid, Volume, Voxels};
use glam::{DMat3, DVec3};
use std::path::PathBuf;

const CENTRE: DVec3 = DVec3::new(12.0, -140.0, -812.0);

fn grid() -> Grid {
    let size = [12, 10, 11];
    let half = DVec3::new(5.5, 4.5, 5.0) * DVec3::new(4.0, 4.0, 5.0);
    Grid::upright(size, DVec3::new(4.0, 4.0, 5.0), CENTRE - half)
}

fn ball(radius: f64) -> Mesh {
    let value = |p: DVec3| radius - (p - CENTRE).length();
    let volume = Volume::of(grid(), value, "ball").unwrap();
    isosurface(&volume, 0.0, Parts::Largest, "ball").unwrap()
}

/// Displacement to a phase: breathing along the body, with a position-dependent shear.
fn moved(p: DVec3, percent: f64) -> DVec3 {
    let depth = (percent * 0.02 * std::f64::consts::PI).cos() + 1.0;
    depth * DVec3::new(0.0, -2.0, 4.0 + 0.05 * (p - CENTRE).y)
}

const TEXT: &str = "name = \"p01\"\nreference_phase = 50\nisocentre_mm = [12, -140.0, -812.0]\n\
    spacing_mm = [4.0, 4, 5]\nskin = \"skin.ply\"\ntumour = \"tumour.ply\"\nct = \"ct_50.mha\"\n\
    \n[[phase]]\npercent = 0\nfield = \"dvf_00.mha\"\n\n[[phase]]\npercent = 50\nfield = \"dvf_50.mha\"\n";

/// Creates a valid folder.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().to_owned();
    std::fs::write(path.join("planning.toml"), TEXT).unwrap();
    ply::write_mesh(&path.join("skin.ply"), &ball(17.0)).unwrap();
    ply::write_mesh(&path.join("tumour.ply"), &ball(6.0)).unwrap();
    for percent in [0.0, 50.0] {
        let field = Field::of(grid(), |p| moved(p, percent), "dvf").unwrap();
        let name = path.join(format!("dvf_{percent:02}.mha"));
        write_field(&name, &field, Packing::Zlib).unwrap();
    }
    let ct = Volume::new(grid(), Voxels::I16(vec![40; grid().voxels()]), "ct").unwrap();
    write_volume(&path.join("ct_50.mha"), &ct, Packing::Zlib).unwrap();
    (dir, path)
}

#[test]
fn a_folder_is_handed_out_about_the_isocentre() {
    let (_dir, path) = folder();
    let planning = Planning::load(&path).unwrap();
    assert_eq!(
        (planning.name.as_str(), planning.reference_percent),
        ("p01", 50.0)
    );
    let far = |mesh: &Mesh| mesh.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
    assert!((far(&planning.skin) - 17.0).abs() < 0.2);
    assert!((far(&planning.tumour) - 6.0).abs() < 0.2);
    let [(start, inhaled), (middle, exhaled)] = &planning.phases[..] else {
        panic!("two phases");
    };
    assert_eq!((*start, *middle), (0.0, 50.0));
    let p = DVec3::new(3.0, -5.0, 7.5);
    let u = inhaled.at(p).unwrap();
    assert!((u - moved(CENTRE + p, 0.0)).length() < 1e-4, "{u}");
    assert!(exhaled.longest_mm() < 1e-6);
    let folder = Folder::open(&path).unwrap();
    assert_eq!(folder.ct().unwrap().unwrap().grid(), &folder.grid());
    assert!((folder.grid().origin_mm + CENTRE - grid().origin_mm).length() < 1e-12);
}

#[test]
fn saved_planning_loads_equal() {
    let (_dir, path) = folder();
    let planning = Planning::load(&path).unwrap();
    let again = path.join("a/b");
    planning.save(&again, false).unwrap();
    assert_eq!(Planning::load(&again).unwrap(), planning);
    let refused = planning.save(&again, false).unwrap_err();
    assert_eq!(refused.exit_code(), 2, "{refused}");
    planning.save(&again, true).unwrap();
    let file = PlanningFile::read(&path).unwrap();
    assert_eq!(PlanningFile::parse(&file.to_toml(), "p").unwrap(), file);
}

#[test]
fn refuses_invalid_planning_file_with_its_line() {
    for (from, to, words) in [
        ("\"p01\"", "\"p 01\"", "planning.toml:1: name: \"p 01\""),
        (
            "reference_phase = 50",
            "reference_phase = 30",
            "2: reference_phase: 30; expected one of the phases: 0, 50",
        ),
        (
            "reference_phase",
            "reference",
            "planning.toml:2: unknown field `reference`",
        ),
        (
            "[12, -140.0, -812.0]",
            "[12, -140.0]",
            "3: isocentre_mm: a list of 2 numbers; expected 3",
        ),
        (
            "[12, -140.0, -812.0]",
            "[12, nan, 0]",
            "3: isocentre_mm: [12.0, NaN, 0.0]",
        ),
        (
            "[4.0, 4, 5]",
            "[4.0, 4]",
            "4: spacing_mm: a list of 2 numbers; expected 3",
        ),
        (
            "[4.0, 4, 5]",
            "0",
            "4: spacing_mm: [0.0, 0.0, 0.0]; expected 0.1 to 50 mm",
        ),
        ("[4.0, 4, 5]", "\"4\"", "a number or a list of 3 numbers"),
        (
            "\"skin.ply\"",
            "\"../skin.ply\"",
            "5: skin: \"../skin.ply\"; expected the name of a file",
        ),
        (
            "\"tumour.ply\"",
            "\"/tumour.ply\"",
            "6: tumour: \"/tumour.ply\"",
        ),
        ("\"ct_50.mha\"", "\"\"", "7: ct: \"\""),
        (
            "percent = 0",
            "percent = -1",
            "10: phase[0].percent: -1; expected 0 or more",
        ),
        (
            "percent = 0",
            "percent = 50",
            "phase[1].percent: 50 after 50; expected phases that ascend",
        ),
        ("percent = 50", "percent = 100", "phase[1].percent: 100"),
        (
            "[[phase]]\npercent = 0\nfield = \"dvf_00.mha\"\n",
            "",
            "phase: 1 phases; expected 2 to 64",
        ),
    ] {
        let text = TEXT.replacen(from, to, 1);
        assert_ne!(text, TEXT);
        let words_found = PlanningFile::parse(&text, "planning.toml")
            .unwrap_err()
            .to_string();
        assert!(words_found.contains(words), "{words}\n{words_found}");
    }
    let one = TEXT.replace("[4.0, 4, 5]", "4");
    let spacing = PlanningFile::parse(&one, "p").unwrap().spacing_mm;
    assert_eq!(spacing, Spacing(DVec3::splat(4.0)));
}

/// Returns the error message after a modification of the folder.
fn complaint(change: impl Fn(&Path)) -> String {
    let (_dir, path) = folder();
    change(&path);
    let error = Planning::load(&path).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    error.to_string()
}

#[test]
fn refuses_fields_that_do_not_match() {
    let other = |grid: Grid| {
        complaint(|path| {
            let field = Field::of(grid, |_| DVec3::ZERO, "dvf").unwrap();
            write_field(&path.join("dvf_50.mha"), &field, Packing::Plain).unwrap();
        })
    };
    let mut wrong = grid();
    wrong.size[2] = 12;
    let found = other(wrong);
    assert!(
        found.contains("planning.toml:15: phase[1].field: "),
        "{found}"
    );
    assert!(found.contains(
        "dvf_50.mha: 12 x 10 x 12 voxels; expected 12 x 10 x 11 voxels, as in dvf_00.mha"
    ));
    wrong = grid();
    wrong.spacing_mm.z = 5.5;
    assert!(
        other(wrong).contains(
            "a spacing of (4, 4, 5.5); expected a spacing of (4, 4, 5), as in dvf_00.mha"
        )
    );
    wrong = grid();
    wrong.origin_mm.x += 1.0;
    assert!(other(wrong).contains("an origin at"));
    wrong = grid();
    wrong.direction = DMat3::from_rotation_z(0.1);
    assert!(other(wrong).contains("directions"));
    let moving = complaint(|path| {
        std::fs::copy(path.join("dvf_00.mha"), path.join("dvf_50.mha")).unwrap();
    });
    assert!(
        moving.contains("at most 0.5 mm from the reference phase to itself"),
        "{moving}"
    );
    let ct = complaint(|path| {
        std::fs::copy(path.join("ct_50.mha"), path.join("dvf_50.mha")).unwrap();
    });
    assert!(
        ct.contains("1 number per voxel; expected three numbers per voxel: a displacement field"),
        "{ct}"
    );
    let absent = complaint(|path| std::fs::remove_file(path.join("dvf_50.mha")).unwrap());
    assert!(
        absent.contains("phase[1].field: ") && absent.contains("an existing file"),
        "{absent}"
    );
    let spacing = complaint(|path| {
        let text = TEXT.replace("[4.0, 4, 5]", "4");
        std::fs::write(path.join("planning.toml"), text).unwrap();
    });
    assert!(spacing.contains("spacing_mm: (4, 4, 4), unlike dvf_00.mha; expected (4, 4, 5)"));
}

#[test]
fn refuses_ct_that_does_not_contain_the_fields() {
    let other = |grid: Grid| {
        complaint(|path| {
            let ct = Volume::new(grid, Voxels::I16(vec![0; grid.voxels()]), "ct").unwrap();
            write_volume(&path.join("ct_50.mha"), &ct, Packing::Plain).unwrap();
        })
    };
    let found = other(grid().shifted(DVec3::new(0.0, 0.0, 40.0)));
    assert!(found.contains("planning.toml:7: ct: "), "{found}");
    assert!(
        found.contains("a CT that spans (") && found.contains("a CT that contains the fields"),
        "{found}"
    );
    let mut turned = grid();
    turned.direction = DMat3::from_rotation_z(0.1);
    assert!(other(turned).contains("axis 0 along"));
    // A CT has finer voxels and encloses the fields.
    let (_dir, path) = folder();
    let fine = Grid::upright([60, 50, 60], DVec3::ONE, grid().origin_mm - 2.0);
    let ct = Volume::new(fine, Voxels::I16(vec![0; fine.voxels()]), "ct").unwrap();
    write_volume(&path.join("ct_50.mha"), &ct, Packing::Plain).unwrap();
    Folder::open(&path).unwrap();
}

#[test]
fn refuses_surfaces_that_do_not_fit() {
    let mesh = |name: &'static str, change: fn(&mut Mesh)| {
        complaint(|path| {
            let mut mesh = ball(6.0);
            change(&mut mesh);
            ply::write_mesh(&path.join(name), &mesh).unwrap();
        })
    };
    let far = mesh("skin.ply", |m| {
        m.vertices.iter_mut().for_each(|v| *v -= CENTRE)
    });
    assert!(
        far.contains("skin.ply: ") && far.contains("vertices outside of the fields"),
        "{far}"
    );
    assert!(far.contains("expected vertices within ("), "{far}");
    let absent = complaint(|path| std::fs::remove_file(path.join("tumour.ply")).unwrap());
    assert!(absent.contains("planning.toml: tumour: "), "{absent}");
    let open = mesh("tumour.ply", |m| m.triangles.truncate(9));
    assert!(
        open.contains("tumour.ply: an open edge between vertices"),
        "{open}"
    );
    let inward = mesh("tumour.ply", |m| {
        m.triangles.iter_mut().for_each(|t| t.swap(0, 1))
    });
    assert!(inward.contains("normals point outwards"), "{inward}");
    let twice = mesh("tumour.ply", |m| m.triangles.push(m.triangles[0]));
    assert!(
        twice.contains("two triangles with the same directed edge"),
        "{twice}"
    );
}
