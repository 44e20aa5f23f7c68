//! Inconsistent inputs, each with its message, and no files left behind.

use super::*;
use crate::volume::Voxels;
use glam::DMat3;

/// Returns the error message after a modification; the output folder must not exist afterwards.
fn complaint(change: impl Fn(&Path, &mut Import)) -> String {
    let (dir, mut import) = small();
    change(dir.path(), &mut import);
    let out = dir.path().join("planning");
    let error = import.write(&out, &silent).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    assert!(!out.exists(), "{error}");
    error.to_string()
}

fn has(found: &str, words: &[&str]) {
    for word in words {
        assert!(found.contains(word), "{word}\n{found}");
    }
}

#[test]
fn refuses_invalid_phases_by_name() {
    let twice = complaint(|_, import| import.phases[1].0 = 0.0);
    has(
        &twice,
        &[
            "phase 0 %: ",
            "30.mhd: a second field; expected one field per phase: phase 0 %: ",
        ],
    );
    let late = complaint(|_, import| import.phases[1].0 = 100.0);
    has(
        &late,
        &[
            "phase 100 %: ",
            ": 100; expected per cent of the cycle, 0 or more, less than 100",
        ],
    );
    let nan = complaint(|_, import| import.reference_percent = f64::NAN);
    has(&nan, &["NaN; expected per cent of the cycle"]);
    let alone = complaint(|_, import| import.phases.drain(..2).for_each(drop));
    has(&alone, &["1 phases with the reference; expected 2 to 64"]);
    let none = complaint(|_, import| import.phases.clear());
    has(&none, &["expected 2 to 64 phases"]);
    let name = complaint(|_, import| import.name = "J. Doe".to_owned());
    has(&name, &["\"J. Doe\"; expected 1 to 64 letters"]);
}

#[test]
fn refuses_fields_that_do_not_match() {
    let with = |grid: Grid| {
        complaint(move |_, import| {
            let field = Field::of(grid, |_| DVec3::ZERO, "dvf").unwrap();
            write_field(&import.phases[1].1, &field, Packing::Plain).unwrap();
        })
    };
    let coarse = with(grid(16.0, 64.0));
    has(
        &coarse,
        &[
            "phase 30 %: ",
            "30.mhd: 9 x 9 x 9 voxels; expected 17 x 17 x 17 voxels, as in ",
            "0.mhd",
        ],
    );
    let mut other = grid(8.0, 64.0);
    other.spacing_mm.z = 8.5;
    has(
        &with(other),
        &["a spacing of (8, 8, 8.5); expected a spacing of "],
    );
    let absent = complaint(|dir, import| import.phases[1].1 = dir.join("no.mha"));
    has(&absent, &["phase 30 %: ", "no.mha: ", "an existing file"]);
    let ct = complaint(|_, import| import.phases[1].1 = import.ct.clone());
    has(
        &ct,
        &[
            "phase 30 %: ",
            "ct.mha: 1 number per voxel; expected three numbers per voxel: a displacement field",
        ],
    );
    let moving = complaint(|_, import| import.reference_percent = 30.0);
    has(
        &moving,
        &[
            "30.mhd: displacements of up to ",
            "at most 0.5 mm from the reference phase to itself",
        ],
    );
    let still = complaint(|_, import| {
        for (_, path) in &import.phases {
            let field = Field::of(grid(8.0, 64.0), |_| DVec3::ZERO, "dvf").unwrap();
            write_field(path, &field, Packing::Plain).unwrap();
        }
    });
    has(
        &still,
        &["fields: a skin that moves 0.000 mm at most", "0.1 mm"],
    );
    // Displacements in the wrong unit.
    let long = complaint(|_, import| {
        for (percent, path) in &import.phases {
            let moved = |p| 20.0 * moved(p, *percent);
            let field = Field::of(grid(8.0, 64.0), moved, "dvf").unwrap();
            write_field(path, &field, Packing::Plain).unwrap();
        }
    });
    has(
        &long,
        &[
            "fields: skin or tumour that move up to ",
            " mm; expected 100 mm or less",
        ],
    );
    let metres = complaint(|_, import| {
        let mut wrong = grid(8.0, 64.0);
        wrong.spacing_mm = DVec3::splat(0.008);
        for (_, path) in &import.phases {
            let field = Field::of(wrong, |_| DVec3::ZERO, "dvf").unwrap();
            write_field(path, &field, Packing::Plain).unwrap();
        }
    });
    has(
        &metres,
        &["0.mhd: a spacing of (0.008, 0.008, 0.008); expected 0.1 to 50 mm"],
    );
    let fine = complaint(|_, import| import.spacing_mm = Some(5.0));
    has(
        &fine,
        &[
            "spacing of the fields in mm: 5; expected 8 to 50: ",
            "0.mhd has (8, 8, 8)",
        ],
    );
    // A NaN that is found after the first files were written.
    let nan = complaint(|_, import| {
        let (_, path) = &import.phases[1];
        let mut raw = vec![0; 12 * 17 * 17 * 17];
        raw[48..52].copy_from_slice(&f32::NAN.to_le_bytes());
        let text = std::fs::read_to_string(path).unwrap();
        let text = text.replace("CompressedData = True", "CompressedData = False");
        std::fs::write(path, text.replace("30.zraw", "30.raw")).unwrap();
        std::fs::write(path.with_extension("raw"), raw).unwrap();
    });
    has(&nan, &["30.mhd: voxel 4: a displacement of (NaN, 0, 0)"]);
}

#[test]
fn refuses_fields_that_do_not_cover_skin_and_ct() {
    let with = |grid: Grid| {
        complaint(move |_, import| {
            for (percent, path) in &import.phases {
                let field = Field::of(grid, |p| moved(p, *percent), "dvf").unwrap();
                write_field(path, &field, Packing::Plain).unwrap();
            }
        })
    };
    has(
        &with(grid(8.0, 40.0)),
        &[
            "0.mhd: skin: ",
            " vertices outside of the fields, (",
            "expected vertices within (-28, ",
        ],
    );
    has(
        &with(grid(8.0, 64.0).shifted(DVec3::new(0.0, 300.0, 0.0))),
        &[
            "ct.mha: a CT that spans (",
            "expected a CT that contains the fields, which span (",
        ],
    );
    let mut turned = grid(8.0, 64.0);
    turned.direction = DMat3::from_rotation_z(0.1);
    has(
        &with(turned),
        &["ct.mha: axis 0 along (1, 0, 0); expected as the fields have it: "],
    );
}

#[test]
fn refuses_what_is_no_ct() {
    has(
        &complaint(|dir, import| import.ct = dir.join("no.mha")),
        &["no.mha: "],
    );
    let text = complaint(|dir, import| import.ct = dir.join("ct.nii.gz"));
    has(
        &text,
        &["ct.nii.gz: neither a folder nor a MetaImage; expected a folder with the images of a CT"],
    );
    let empty = complaint(|dir, import| {
        import.ct = dir.join("series");
        std::fs::create_dir(&import.ct).unwrap();
    });
    has(&empty, &["series: no file; expected CT images"]);
    let field = complaint(|_, import| import.ct = import.phases[0].1.clone());
    has(
        &field,
        &["0.mhd: 3 numbers per voxel; expected one number per voxel"],
    );
    let raised = complaint(|_, import| {
        let ct = Volume::of(grid(4.0, 64.0), |p| body(p) + 1000.0, "ct").unwrap();
        write_volume(&import.ct, &ct, Packing::Plain).unwrap();
    });
    has(
        &raised,
        &["ct.mha: 100 % of the voxels at -500 or more; expected Hounsfield units"],
    );
    // Swapped byte order.
    let swapped = complaint(|_, import| {
        let swap = |p| f32::from((body(p) as i16).swap_bytes());
        let ct = Volume::of(grid(4.0, 64.0), |p| f64::from(swap(p)), "ct").unwrap();
        write_volume(&import.ct, &ct, Packing::Plain).unwrap();
    });
    has(
        &swapped,
        &[
            "ct.mha: ",
            " % of the voxels are above 4095 HU: the scale or byte order may be wrong",
            "expected Hounsfield units",
            "above 4095 (metal)",
        ],
    );
    let high = complaint(|_, import| import.skin_hu = 3000.0);
    has(
        &high,
        &["ct.mha: skin: no voxel of 3000 or more; expected a level up to 0"],
    );
}

#[test]
fn refuses_invalid_tumour() {
    let mesh = |change: fn(&mut Mesh)| {
        complaint(move |_, import| {
            let mut mesh = ball(TUMOUR_MM);
            change(&mut mesh);
            ply::write_mesh(&import.tumour, &mesh).unwrap();
        })
    };
    has(
        &mesh(|m| m.triangles.truncate(20)),
        &["tumour.ply: an open edge between vertices"],
    );
    has(
        &mesh(|m| m.triangles.iter_mut().for_each(|t| t.swap(0, 1))),
        &["normals point outwards"],
    );
    let room = mesh(|m| m.vertices.iter_mut().for_each(|v| *v -= CENTRE));
    has(
        &room,
        &[
            "tumour.ply: ",
            "vertices outside of the skin",
            "expected a tumour in the body, whose skin is within (",
        ],
    );
    let edge = mesh(|m| {
        m.vertices
            .iter_mut()
            .for_each(|v| v.x += BODY_MM - TUMOUR_MM + 2.0)
    });
    has(&edge, &[" vertices outside of the skin, ("]);
    has(
        &complaint(|dir, import| import.tumour = dir.join("t.step")),
        &["extension `step`; expected .stl, .obj or .ply, or a mask"],
    );
    let mask = |values: [i16; 2]| {
        complaint(move |dir, import| {
            let grid = grid(8.0, 16.0);
            let mut numbers = vec![values[0]; grid.voxels()];
            numbers[62] = values[1];
            let mask = Volume::new(grid, Voxels::I16(numbers), "mask").unwrap();
            import.tumour = dir.join("mask.mha");
            write_volume(&import.tumour, &mask, Packing::Plain).unwrap();
        })
    };
    has(
        &mask([0, 255]),
        &["mask.mha: numbers from 0 to 255; expected a mask: 0 outside and 1"],
    );
    has(&mask([-1, 1]), &["numbers from -1 to 1"]);
    has(&mask([0, 0]), &["mask.mha: no voxel of the tumour"]);
    let far = complaint(|_, import| import.isocentre_mm = Some(DVec3::ZERO));
    has(
        &far,
        &[
            "isocentre in ",
            "ct.mha: (0, 0, 0) mm; expected a point inside the CT, in its LPS coordinates",
        ],
    );
}

#[test]
fn refuses_to_overwrite_existing_files() {
    for name in ["planning.toml", "skin.ply", "dvf_30.mha"] {
        let (dir, import) = small();
        let out = dir.path().join("planning");
        std::fs::create_dir(&out).unwrap();
        std::fs::write(out.join(name), "mine").unwrap();
        let error = import.write(&out, &silent).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        has(
            &error.to_string(),
            &["planning: ", name, "--force to overwrite"],
        );
        assert_eq!(std::fs::read(out.join(name)).unwrap(), b"mine");
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 1);
    }
}
