//! Series written by pydicom, and a small writer for invalid files.

mod phases;
mod refused;

use super::element::Tag;
use super::*;
use crate::volume::Voxels;
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::PathBuf;

#[test]
fn series_written_by_pydicom_are_read_exactly() {
    // 4 x 3 x 3 voxels of -1000 + i + 10 j + 100 k, in files whose names do not follow the slice order.
    // One series has explicit value representations and unsigned 12-bit values from -1024 HU; the other
    // has implicit value representations and signed values in steps of 1/2 HU from 7.25 HU. Sequences of
    // defined and undefined length and private elements precede the pixels.
    for (folder, lost) in [("explicit", 0.0), ("implicit", 0.25)] {
        let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .join("tests/data/dicom")
            .join(folder);
        let volume = read_series(&folder).unwrap();
        let grid = volume.grid();
        assert_eq!(grid.size, [4, 3, 3]);
        assert!((grid.spacing_mm - DVec3::new(0.9, 1.25, 2.5)).length() < 1e-9);
        assert_eq!(grid.origin_mm, DVec3::new(-12.5, 33.0, -810.25));
        let (sin, cos) = 0.25_f64.sin_cos();
        let axes = [
            DVec3::new(cos, sin, 0.0),
            DVec3::new(-sin, cos, 0.0),
            DVec3::Z,
        ];
        for (axis, exact) in axes.into_iter().enumerate() {
            assert!((grid.direction.col(axis) - exact).length() < 1e-9);
        }
        assert_eq!(matches!(volume.voxels(), Voxels::I16(_)), lost == 0.0);
        for n in 0..36 {
            let exact =
                -1000.0 + (n % 4) as f64 + 10.0 * (n / 4 % 3) as f64 + 100.0 * (n / 12) as f64;
            let off = f64::from(volume.voxels().get(n)) - exact;
            assert!(off.abs() <= lost, "{n}: {off}");
        }
        let slice = read_slice(&folder.join("b.dcm")).unwrap();
        assert_eq!(slice.grid().size, [4, 3, 1]);
        assert!((slice.grid().origin_mm.z + 805.25).abs() < 1e-9);
        let one = Phases::open(&folder).unwrap_err().to_string();
        assert!(
            one.contains("one phase, of series `Thorax, Gated, 30.0%` (1.2.3.100)"),
            "{one}"
        );
    }
}

/// An image of 4 x 3 pixels with one value, explicit VR.
#[derive(Clone)]
struct Image(BTreeMap<Tag, (&'static str, Vec<u8>)>);

impl Image {
    fn new(series: &str, description: &str, z: f64) -> Self {
        let mut image = Self(BTreeMap::new());
        for (tag, text) in [
            ((0x08, 0x16), "1.2.840.10008.5.1.4.1.1.2"),
            ((0x08, 0x103E), description),
            ((0x10, 0x20), "P01"),
            ((0x18, 0x50), "3"),
            ((0x20, 0x0E), series),
            ((0x20, 0x32), &format!("-10\\20\\{z}")),
            ((0x20, 0x37), "1\\0\\0\\0\\1\\0"),
            ((0x20, 0x52), "1.9"),
            ((0x28, 0x30), "1.5\\1.5"),
            ((0x28, 0x1052), "-1024"),
            ((0x28, 0x1053), "1"),
        ] {
            image.text(tag, text);
        }
        for (element, number) in [
            (2, 1),
            (0x10, 3),
            (0x11, 4),
            (0x100, 16),
            (0x101, 12),
            (0x102, 11),
            (0x103, 0),
        ] {
            image.short((0x28, element), number);
        }
        image
            .0
            .insert((0x7FE0, 0x10), ("OW", 24_u16.to_le_bytes().repeat(12)));
        image
    }

    fn text(&mut self, tag: Tag, text: &str) {
        self.0.insert(tag, ("LO", text.as_bytes().to_vec()));
    }

    fn short(&mut self, tag: Tag, number: u16) {
        self.0.insert(tag, ("US", number.to_le_bytes().to_vec()));
    }

    fn bytes(&self) -> Vec<u8> {
        self.of_syntax("1.2.840.10008.1.2.1")
    }

    fn of_syntax(&self, syntax: &str) -> Vec<u8> {
        let mut bytes = vec![0; 128];
        bytes.extend(b"DICM");
        let meta = (&(2, 0x10), &("UI", syntax.as_bytes().to_vec()));
        for (&(group, element), (vr, value)) in [meta].into_iter().chain(&self.0) {
            bytes.extend([group.to_le_bytes(), element.to_le_bytes()].concat());
            bytes.extend(vr.as_bytes());
            let length = value.len() + value.len() % 2;
            match *vr {
                "OW" => {
                    bytes.extend([0, 0]);
                    bytes.extend((length as u32).to_le_bytes());
                }
                _ => bytes.extend((length as u16).to_le_bytes()),
            }
            bytes.extend(value);
            bytes.resize(
                bytes.len() + value.len() % 2,
                if *vr == "UI" { 0 } else { b' ' },
            );
        }
        bytes
    }
}

/// Creates a folder of named images.
fn folder(images: impl IntoIterator<Item = (String, Image)>) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (name, image) in images {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, image.bytes()).unwrap();
    }
    dir
}

/// Five slices, 3 mm apart.
fn series() -> Vec<(String, Image)> {
    (0..5)
        .map(|k| {
            (
                format!("{k}.dcm"),
                Image::new("1.5", "CT", 100.0 + 3.0 * f64::from(k)),
            )
        })
        .collect()
}
