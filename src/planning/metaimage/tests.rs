//! Files of SimpleITK 2.5 (ITK 5.4), files in the form of plastimatch and elastix, and malformed files.

use super::*;
use glam::{DMat3, DVec3};
use std::path::PathBuf;

/// Files written by SimpleITK: 4 x 3 x 2 voxels of `-1000 + i + 10 j + 100 k` in the type given by
/// the name; fields have (i / 2, -j / 4, k + 1/8).
fn itk(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("tests/data/metaimage")
        .join(name)
}

fn each_voxel() -> impl Iterator<Item = (usize, [f64; 3])> {
    (0..24).map(|n| (n, [n % 4, n / 4 % 3, n / 12].map(|x| x as f64)))
}

#[test]
fn volumes_written_by_itk_are_read_exactly() {
    let turned = DMat3::from_rotation_z(-0.3).transpose();
    for (name, offset, direction, whole) in [
        ("oblique_short.mha", 0.0, Some(turned), true),
        ("packed_short.mha", 0.0, Some(turned), true),
        ("packed_double.mhd", 0.25, None, false),
        ("ushort.mha", 2000.0, None, false),
        ("int64.mha", 0.0, None, false),
    ] {
        let volume = read_volume(&itk(name)).unwrap();
        let grid = volume.grid();
        assert_eq!(grid.size, [4, 3, 2], "{name}");
        assert_eq!(grid.spacing_mm, DVec3::new(0.9, 1.25, 2.5));
        assert_eq!(grid.origin_mm, DVec3::new(-12.5, 33.0, -810.25));
        let wanted = direction.unwrap_or(DMat3::IDENTITY);
        assert!(
            (grid.direction - wanted).abs_diff_eq(DMat3::ZERO, 1e-12),
            "{name}"
        );
        assert_eq!(matches!(volume.voxels(), Voxels::I16(_)), whole, "{name}");
        for (n, [i, j, k]) in each_voxel() {
            let exact = -1000.0 + i + 10.0 * j + 100.0 * k + offset;
            assert_eq!(f64::from(volume.voxels().get(n)), exact, "{name}: {n}");
        }
    }
}

#[test]
fn fields_written_by_itk_are_read_exactly() {
    for (name, flip) in [("field_float.mha", 1.0), ("field_double_packed.mha", -1.0)] {
        let field = read_field(&itk(name)).unwrap();
        let across = DVec3::new(1.0, flip, flip);
        assert_eq!(field.grid().direction, DMat3::from_diagonal(across));
        for (n, [i, j, k]) in each_voxel() {
            let exact = [0.5 * i, -0.25 * j, k + 0.125].map(|x| x as f32);
            assert_eq!(field.vectors()[n], exact, "{name}: {n}");
        }
        // Displacements are along the patient's axes, independent of the grid's axes.
        let at = field.grid().point(DVec3::new(2.0, 2.0, 1.0));
        assert!((field.at(at).unwrap() - DVec3::new(1.0, -0.5, 1.125)).length() < 1e-12);
        assert_eq!(read_grid(&itk(name)).unwrap(), (*field.grid(), 3));
    }
}

fn oblique() -> Grid {
    Grid {
        size: [5, 4, 3],
        spacing_mm: DVec3::new(0.9, 1.1, 2.7),
        origin_mm: DVec3::new(-1.0 / 3.0, 17.0, 1e-3),
        direction: DMat3::from_rotation_x(0.7) * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
    }
}

#[test]
fn written_data_read_back_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    let grid = oblique();
    let short = (0..60).map(|n| (n * 1091 - 32000) as i16).collect();
    let float = (0..60).map(|n| (n as f32).exp2() / 3.0).collect();
    let volumes = [Voxels::I16(short), Voxels::F32(float)]
        .map(|voxels| Volume::new(grid, voxels, "volume").unwrap());
    let vectors = (0..60).map(|n| [n as f32 / 7.0, -1e-20, 300.0 - n as f32]);
    let field = Field::new(grid, vectors.collect(), "field").unwrap();
    for packing in [Packing::Plain, Packing::Zlib] {
        for extension in ["mha", "mhd", "MHA"] {
            let path = dir.path().join(format!("v.{extension}"));
            for volume in &volumes {
                write_volume(&path, volume, packing).unwrap();
                assert_eq!(read_volume(&path).unwrap(), *volume);
            }
            write_field(&path, &field, packing).unwrap();
            assert_eq!(read_field(&path).unwrap(), field);
            let head = std::fs::read(&path).unwrap();
            let text = String::from_utf8_lossy(&head);
            assert!(text.contains("AnatomicalOrientation = LAI"), "{text}");
        }
    }
    let other = write_field(&dir.path().join("a.nii"), &field, Packing::Plain).unwrap_err();
    assert!(other.to_string().contains("extension `nii`"), "{other}");
}

/// A header with lines changed or added, followed by 24 values of two bytes, big endian.
fn with(lines: &[(&str, &str)]) -> Vec<u8> {
    let mut keys = vec![
        ("ObjectType", "Image"),
        ("NDims", "3"),
        ("BinaryData", "True"),
        ("ElementByteOrderMSB", "True"),
        ("Position", "1 2 3"),
        ("ElementSize", "1 1 2"),
        ("DimSize", "4 3 2"),
        ("ElementType", "MET_SHORT"),
        ("ElementDataFile", "LOCAL"),
    ];
    for &(key, value) in lines {
        match keys.iter_mut().find(|(k, _)| *k == key) {
            Some(line) => line.1 = value,
            None => keys.insert(3, (key, value)),
        }
    }
    let text: String = keys
        .iter()
        .filter(|(_, value)| *value != "-")
        .map(|(key, value)| format!("{key} = {value}\r\n"))
        .collect();
    let numbers = (0..24_i16).flat_map(|n| (256 * n + 3).to_be_bytes());
    [text.into_bytes(), numbers.collect()].concat()
}

fn read(bytes: &[u8]) -> Result<Volume> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("f.mha");
    std::fs::write(&path, bytes).unwrap();
    read_volume(&path)
}

#[test]
fn synonyms_and_other_line_orders_are_read_alike() {
    let volume = read(&with(&[])).unwrap();
    assert_eq!(volume.grid().spacing_mm, DVec3::new(1.0, 1.0, 2.0));
    assert_eq!(volume.grid().origin_mm, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(volume.voxels().get(23), (256 * 23 + 3) as f32);
    // A spacing next to a different ElementSize.
    let both = read(&with(&[
        ("ElementSpacing", "2 2 2"),
        ("Modality", "MET_MOD_CT"),
    ]));
    assert_eq!(both.unwrap().grid().spacing_mm, DVec3::splat(2.0));
    let bare = read(&with(&[
        ("Position", "-"),
        ("AnatomicalOrientation", "RAI"),
    ]));
    assert_eq!(bare.unwrap().grid().origin_mm, DVec3::ZERO);
}

#[test]
fn fields_of_plastimatch_are_read() {
    // Text in the form of plastimatch's writer, numbers formatted by C's %g and %f.
    let head = "ObjectType = Image\nNDims = 3\nBinaryData = True\n\
                BinaryDataByteOrderMSB = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n\
                Offset = -250. 0. 1e+02\nCenterOfRotation = 0 0 0\n\
                ElementSpacing = 0.976562 0.976562 2.500000\nDimSize = 2 1 2\n\
                AnatomicalOrientation = RAI\nElementNumberOfChannels = 3\n\
                ElementType = MET_FLOAT\nElementDataFile = LOCAL\n";
    let numbers = (0..12).flat_map(|n| (0.5 * n as f32).to_le_bytes());
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("vf.mha");
    std::fs::write(
        &path,
        [head.as_bytes(), &numbers.collect::<Vec<u8>>()].concat(),
    )
    .unwrap();
    let field = read_field(&path).unwrap();
    assert_eq!(field.grid().origin_mm, DVec3::new(-250.0, 0.0, 100.0));
    assert_eq!(field.vectors()[3], [4.5, 5.0, 5.5]);
    // Six digits of 1000 / 1024 mm still count as the same grid.
    let exact = DVec3::new(0.9765625, 0.9765625, 2.5);
    let ct = Grid::upright([2, 1, 2], exact, field.grid().origin_mm);
    assert_eq!(field.grid().difference(&ct), None);
}

#[test]
fn errors_name_line_and_key() {
    for (line, words) in [
        (
            ("ObjectType", "Scene"),
            "f.mha:1: ObjectType: `Scene`; expected Image",
        ),
        (
            ("NDims", "4"),
            "f.mha:2: NDims: 4: a series of volumes in one file",
        ),
        (("NDims", "2"), "NDims: 2; expected 3"),
        (("NDims", "three"), "NDims: `three`; expected 3"),
        (
            ("BinaryData", "False"),
            "BinaryData: `False`; expected True",
        ),
        (
            ("ElementByteOrderMSB", "big"),
            "`big`; expected True or False",
        ),
        (
            ("Position", "1 2"),
            "f.mha:5: Position: `1 2`; expected 3 numbers",
        ),
        (("Position", "1 2 3 4"), "`1 2 3 4`; expected 3 numbers"),
        (
            ("Offset", "0 0 0"),
            "`1 2 3` after `0 0 0`; expected one value",
        ),
        (("ElementSize", "-"), "no ElementSpacing"),
        (("ElementSize", "1 0 1"), "a spacing of (1, 0, 1)"),
        (("ElementSize", "1 nan 1"), "a spacing of (1, NaN, 1)"),
        (("DimSize", "-"), "no DimSize"),
        (("DimSize", "4 -3 2"), "`4 -3 2`; expected 3 numbers"),
        (("DimSize", "4 3 0"), "4 x 3 x 0 voxels"),
        (
            ("DimSize", "4 3 3"),
            "48 bytes of data; expected 4 x 3 x 3 voxels x 1 x 2 bytes = 72 bytes",
        ),
        (
            ("DimSize", "4 3 1"),
            "48 bytes of data; expected 4 x 3 x 1 voxels",
        ),
        (
            ("DimSize", "18446744073709551615 2 1"),
            "voxels along each axis",
        ),
        (("DimSize", "16384 16384 2"), "voxels in all"),
        (
            ("TransformMatrix", "1 0 0 0 1 0 0 0 0"),
            "directions (1, 0, 0)",
        ),
        (("TransformMatrix", "1 0 0 0 1 0"), "expected 9 numbers"),
        (
            ("AnatomicalOrientation", "LPS"),
            "`LPS` without a TransformMatrix",
        ),
        (
            ("ElementNumberOfChannels", "3"),
            "3 numbers per voxel; expected one number per voxel",
        ),
        (
            ("ElementNumberOfChannels", "2"),
            "ElementNumberOfChannels: 2; expected 1 or 3",
        ),
        (
            ("ElementType", "MET_OTHER"),
            "`MET_OTHER`; expected MET_CHAR",
        ),
        (("ElementType", "-"), "no ElementType"),
        (("CompressedData", "True"), "cannot be unpacked"),
        (("ElementDataFile", "LIST"), "slices in files of their own"),
        (
            ("ElementDataFile", "s%03d.raw 1 2 1"),
            "slices in files of their own",
        ),
        (("ElementDataFile", "absent.raw"), "an existing file"),
        (("ElementDataFile", "-"), "f.mha:9: "),
        (
            ("HeaderSize", "4"),
            "HeaderSize: 4; expected 0 for LOCAL data",
        ),
    ] {
        let error = read(&with(&[line])).unwrap_err();
        assert!(error.to_string().contains(words), "{line:?}: {error}");
        assert_eq!(error.exit_code(), 2, "{line:?}: {error}");
    }
    let error = read(b"\x89PNG\r\n").unwrap_err().to_string();
    assert!(
        error.contains("f.mha:1: `\u{fffd}PNG`; expected a MetaImage header"),
        "{error}"
    );
    let error = read(b"").unwrap_err().to_string();
    assert!(error.contains("no ElementDataFile"), "{error}");
    let channels = read_volume(&itk("field_float.mha"))
        .unwrap_err()
        .to_string();
    assert!(
        channels.contains("3 numbers per voxel; expected one number"),
        "{channels}"
    );
    let channels = read_field(&itk("ushort.mha")).unwrap_err().to_string();
    assert!(channels.contains("1 number per voxel"), "{channels}");
    let four = read_volume(&itk("four.mha")).unwrap_err().to_string();
    assert!(four.contains("a series of volumes in one file"), "{four}");
}

#[test]
fn refuses_packed_data_that_differ_from_the_header() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("p.mha");
    let volume = Volume::new(oblique(), Voxels::I16(vec![7; 60]), "v").unwrap();
    write_volume(&path, &volume, Packing::Zlib).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let changed = |from: &str, to: &str, cut: usize| {
        let at = whole.windows(from.len()).position(|w| w == from.as_bytes());
        let (head, rest) = whole.split_at(at.unwrap());
        let mut bytes = [head, to.as_bytes(), &rest[from.len()..]].concat();
        bytes.truncate(bytes.len() - cut);
        std::fs::write(&path, bytes).unwrap();
        read_volume(&path).unwrap_err().to_string()
    };
    let long = changed("DimSize = 5 4 3", "DimSize = 5 4 4", 0);
    assert!(
        long.contains("120 bytes of data; expected 5 x 4 x 4"),
        "{long}"
    );
    let short = changed("DimSize = 5 4 3", "DimSize = 5 4 2", 0);
    assert!(short.contains("more than 80 bytes of data"), "{short}");
    let cut = changed("NDims = 3", "NDims = 3", 3);
    assert!(cut.contains("as in CompressedDataSize"), "{cut}");
    let cut = changed("CompressedDataSize", "Comment", 3);
    assert!(cut.contains("cannot be unpacked"), "{cut}");
    // No memory is allocated for more than the given bytes can expand to.
    let bomb = changed("DimSize = 5 4 3", "DimSize = 512 512 512", 0);
    assert!(bomb.contains("bytes of packed data"), "{bomb}");
}

#[test]
fn refuses_voxels_that_are_not_finite() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("f.mhd");
    let grid = Grid::upright([2, 2, 1], DVec3::ONE, DVec3::ZERO);
    let volume = Volume::new(grid, Voxels::F32(vec![0.0; 4]), "v").unwrap();
    write_volume(&path, &volume, Packing::Plain).unwrap();
    let mut raw = vec![0; 16];
    raw[8..12].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(dir.path().join("f.raw"), &raw).unwrap();
    let words = read_volume(&path).unwrap_err().to_string();
    assert!(
        words.contains("f.mhd: voxel 2: NaN; expected finite numbers"),
        "{words}"
    );
    // A data file with leading bytes before the data.
    let text = std::fs::read_to_string(&path).unwrap();
    let mut long = b"what the scanner said first".to_vec();
    long.extend([0; 16]);
    std::fs::write(dir.path().join("f.raw"), &long).unwrap();
    for skip in ["27", "-1"] {
        let header = text.replace("ElementType", &format!("HeaderSize = {skip}\nElementType"));
        std::fs::write(&path, header).unwrap();
        assert_eq!(read_volume(&path).unwrap(), volume);
    }
}
