//! Inconsistent inputs, each with its own error message.

use super::{Import, from};
use glam::DVec3;
use phasmid::geometry::{Mesh, ply};
use phasmid::patient::metaimage::{Packing, read_volume, write_field, write_volume};
use phasmid::patient::volume::{Field, Grid, Volume, Voxels};
use tempfile::tempdir;

#[test]
fn refuses_input_that_does_not_fit_by_name() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let ct = read_volume(&from().join("ct_50.mha")).unwrap();
    let grid = *ct.grid();
    let field = |grid: Grid, name: &str| {
        let field = Field::of(grid, |_| DVec3::ZERO, "dvf").unwrap();
        write_field(&path(name), &field, Packing::Plain).unwrap();
        path(name).display().to_string()
    };

    // Arguments that are not valid.
    let mut import = Import::new();
    import.phases[2] = "twenty=dvf_20.mha".to_owned();
    import.refused(&["--phase twenty=dvf_20.mha: no phase; expected PERCENT=FILE"]);
    Import::new()
        .with(&["--isocentre", "1,2"])
        .refused(&["--isocentre 1,2: not three numbers; expected X,Y,Z in millimetres"]);
    Import::new().with(&["--isocentre", "0,-900,0"]).refused(&[
        "isocentre in ",
        ": (0, -900, 0) mm; expected a point inside the CT, in its LPS",
    ]);
    Import::new()
        .with(&["--name", "J. Doe"])
        .refused(&["patient's name: \"J. Doe\"; expected 1 to 64 letters"]);

    // Displacement fields that do not match each other, the CT or the body.
    let mut coarse = grid;
    coarse.spacing_mm = DVec3::splat(12.5);
    let mut import = Import::new();
    import.phases[3] = format!("30={}", field(coarse, "coarse.mha"));
    import.refused(&[
        "phase 30 %: ",
        "coarse.mha: a spacing of (12.5, 12.5, 12.5); expected a spacing of ",
    ]);
    let mut import = Import::new();
    import.phases.push(import.phases[3].clone());
    import.refused(&[
        "phase 30 %: ",
        "dvf_30.mha: a second field; expected one field per phase",
    ]);
    let of_all = |grid: Grid, name: &str| {
        let mut import = Import::new();
        let file = field(grid, name);
        import.phases = vec![format!("0={file}"), format!("50={file}")];
        import
    };
    of_all(grid.shifted(DVec3::new(0.0, 0.0, 900.0)), "elsewhere.mha").refused(&[
        "ct_50.mha: a CT that spans (",
        "expected a CT that contains the fields, which span (",
    ]);
    let mut short = grid;
    short.size[2] /= 2;
    of_all(short, "short.mha").refused(&[
        "short.mha: skin: ",
        " vertices outside of the fields, (",
        "expected vertices within (",
    ]);
    Import::new().with(&["--reference-phase", "0"]).refused(&[
        "dvf_00.mha: displacements of up to ",
        "at most 0.5 mm from the reference phase to itself",
    ]);

    // A file that is not a CT.
    let mut import = Import::new();
    import.ct = path("absent.mha");
    import.refused(&["absent.mha: "]);
    import.ct = from().join("dvf_00.mha");
    import.refused(&["dvf_00.mha: 3 numbers per voxel; expected one number per voxel"]);
    let raised = (0..ct.voxels().len()).map(|n| ct.voxels().get(n) as i16 + 1000);
    let raised = Volume::new(grid, Voxels::I16(raised.collect()), "ct").unwrap();
    import.ct = path("raised.mha");
    write_volume(&import.ct, &raised, Packing::Zlib).unwrap();
    import.refused(&["raised.mha: 100 % of the voxels at -500 or more; expected Hounsfield units"]);
    Import::new()
        .with(&["--skin-hu", "5000"])
        .refused(&["ct_50.mha: skin: no voxel of 5000 or more; expected a level up to "]);

    // A tumour whose mesh is not closed, or that lies outside of the body.
    let mesh = Mesh::read(&from().join("tumour.ply")).unwrap();
    let mut import = Import::new();
    import.tumour = path("tumour.ply");
    let mut open = mesh.clone();
    open.triangles.pop();
    ply::write_mesh(&import.tumour, &open).unwrap();
    import.refused(&["tumour.ply: an open edge between vertices"]);
    let mut beside = mesh;
    beside.vertices.iter_mut().for_each(|v| v.y -= 300.0);
    ply::write_mesh(&import.tumour, &beside).unwrap();
    import.refused(&[
        "tumour.ply: ",
        " vertices outside of the skin, (",
        "expected a tumour in the body",
    ]);
    import.tumour = path("tumour.step");
    import.refused(&["tumour.step: extension `step`; expected .stl, .obj or .ply, or a mask"]);
}
