//! The CT as DICOM: a complete series, an incomplete series, a series among others, and a 4D-CT.

use super::{Import, from};
use phasmid::geometry::Mesh;
use phasmid::patient::metaimage::read_volume;
use phasmid::patient::volume::{Volume, Voxels};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tempfile::tempdir;

/// Writes a CT's slices as DICOM, explicit VR, integers from -1024.
fn dicom(ct: &Volume, series: &str, description: &str, folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let grid = ct.grid();
    let [ni, nj, nk] = grid.size;
    let (spacing, origin) = (grid.spacing_mm, grid.origin_mm);
    for k in 0..nk {
        let mut elements: BTreeMap<(u16, u16), (&str, Vec<u8>)> = BTreeMap::new();
        let z = origin.z + spacing.z * k as f64;
        for (tag, text) in [
            ((0x08, 0x16), "1.2.840.10008.5.1.4.1.1.2"),
            ((0x08, 0x103E), description),
            ((0x10, 0x20), "P07"),
            ((0x20, 0x0E), series),
            ((0x20, 0x32), &format!("{}\\{}\\{z}", origin.x, origin.y)),
            ((0x20, 0x37), "1\\0\\0\\0\\1\\0"),
            ((0x20, 0x52), "1.9"),
            ((0x28, 0x30), &format!("{}\\{}", spacing.y, spacing.x)),
            ((0x28, 0x1052), "-1024"),
            ((0x28, 0x1053), "1"),
        ] {
            elements.insert(tag, ("LO", text.as_bytes().to_vec()));
        }
        for (element, number) in [
            (0x02, 1),
            (0x10, nj as u16),
            (0x11, ni as u16),
            (0x100, 16),
            (0x101, 12),
            (0x102, 11),
            (0x103, 0),
        ] {
            elements.insert((0x28, element), ("US", number.to_le_bytes().to_vec()));
        }
        let pixels = (0..ni * nj).flat_map(|n| {
            let stored = ct.voxels().get(n + ni * nj * k) + 1024.0;
            (stored as u16).to_le_bytes()
        });
        elements.insert((0x7FE0, 0x10), ("OW", pixels.collect()));
        let mut bytes = vec![0; 128];
        bytes.extend(b"DICM");
        let meta = (&(2, 0x10), &("UI", b"1.2.840.10008.1.2.1\0".to_vec()));
        for (&(group, element), (vr, value)) in [meta].into_iter().chain(&elements) {
            bytes.extend([group.to_le_bytes(), element.to_le_bytes()].concat());
            bytes.extend(vr.as_bytes());
            let length = value.len() + value.len() % 2;
            if *vr == "OW" {
                bytes.extend([0, 0]);
                bytes.extend((length as u32).to_le_bytes());
            } else {
                bytes.extend((length as u16).to_le_bytes());
            }
            bytes.extend(value);
            bytes.resize(bytes.len() + value.len() % 2, b' ');
        }
        fs::write(folder.join(format!("{k:03}.dcm")), bytes).unwrap();
    }
}

#[test]
fn a_series_of_dicom_shows_the_same_skin() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let ct = read_volume(&from().join("ct_50.mha")).unwrap();
    Import::new().made(&path("image"));
    let mut import = Import::new();
    import.ct = path("series");
    dicom(&ct, "1.5.1", "Thorax", &import.ct);
    let said = import.made(&path("one"));
    assert!(said.contains("  ct          `Thorax` (1.5.1): "), "{said}");
    let skin = |name: &str| Mesh::read(&path(name).join("skin.ply")).unwrap();
    let (image, one) = (skin("image"), skin("one"));
    assert_eq!(image.triangles, one.triangles);
    for (a, b) in image.vertices.iter().zip(&one.vertices) {
        assert!((*a - *b).length() < 1e-6, "{a} {b}");
    }
    // A slice is missing, and the folder also holds images of another series.
    fs::remove_file(import.ct.join("020.dcm")).unwrap();
    import.refused(&[
        "021.dcm: a slice missing between it and ",
        "019.dcm; expected a slice every 12.000 mm",
    ]);
    dicom(&ct, "1.5.2", "Thorax", &path("other"));
    fs::rename(path("other").join("020.dcm"), import.ct.join("020.dcm")).unwrap();
    import.refused(&[
        "series: series without a phase: `Thorax` (1.5.1), ",
        "`Thorax` (1.5.2), 1 images; expected one series",
    ]);

    // The reference phase of a 4D-CT is used, whatever other series the folder holds.
    let four = path("four");
    let far = Voxels::I16(vec![-1000; ct.voxels().len()]);
    let air = Volume::new(*ct.grid(), far, "air").unwrap();
    dicom(&air, "1.6.0", "Gated, 0.0%", &four.join("a"));
    dicom(&ct, "1.6.5", "Gated, 50.0%", &four.join("b"));
    dicom(&air, "1.6.9", "Average", &four.join("c"));
    import.ct = four;
    let said = import.made(&path("of-four"));
    assert!(said.contains("`Gated, 50.0%` (1.6.5): "), "{said}");
    assert_eq!(skin("of-four").triangles, image.triangles);
    let import = import.with(&["--reference-phase", "30"]);
    import.refused(&[
        "four: phases 0, 50 %, and `Average` (1.6.9), ",
        "expected phase 30 %",
    ]);
}
