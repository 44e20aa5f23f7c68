//! Series of pydicom's, a writer of our own for what is wrong, and names that say a phase.

use super::element::Tag;
use super::phases::in_words;
use super::*;
use crate::patient::volume::Voxels;
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::PathBuf;

#[test]
fn series_of_pydicom_are_read_as_it_meant_them() {
    // 4 x 3 x 3 voxels of -1000 + i + 10 j + 100 k, in files whose names are not in the slices'
    // order: explicit, unsigned in 12 bits from -1024; implicit, signed in halves from 7.25. Before
    // the pixels stand sequences of defined and undefined length and private elements.
    for (folder, lost) in [("explicit", 0.0), ("implicit", 0.25)] {
        let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
            .join("tests/dicom")
            .join(folder);
        let volume = read_series(&folder).unwrap();
        let grid = volume.grid();
        assert_eq!(grid.size, [4, 3, 3]);
        assert!((grid.spacing_mm - DVec3::new(0.9, 1.25, 2.5)).length() < 1e-9);
        assert_eq!(grid.origin_mm, DVec3::new(-12.5, 33.0, -810.25));
        let (sin, cos) = 0.25_f64.sin_cos();
        let axes = [DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z];
        for (axis, exact) in axes.into_iter().enumerate() {
            assert!((grid.direction.col(axis) - exact).length() < 1e-9);
        }
        assert_eq!(matches!(volume.voxels(), Voxels::I16(_)), lost == 0.0);
        for n in 0..36 {
            let exact = -1000.0 + (n % 4) as f64 + 10.0 * (n / 4 % 3) as f64 + 100.0 * (n / 12) as f64;
            let off = f64::from(volume.voxels().get(n)) - exact;
            assert!(off.abs() <= lost, "{n}: {off}");
        }
        let slice = read_slice(&folder.join("b.dcm")).unwrap();
        assert_eq!(slice.grid().size, [4, 3, 1]);
        assert!((slice.grid().origin_mm.z + 805.25).abs() < 1e-9);
        let one = Phases::open(&folder).unwrap_err().to_string();
        assert!(one.contains("one phase, of series `Thorax, Gated, 30.0%` (1.2.3.100)"), "{one}");
    }
}

/// An image of 4 x 3 pixels, explicit VR, all of one number.
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
        for (element, number) in [(2, 1), (0x10, 3), (0x11, 4), (0x100, 16), (0x101, 12), (0x102, 11), (0x103, 0)] {
            image.short((0x28, element), number);
        }
        image.0.insert((0x7FE0, 0x10), ("OW", 24_u16.to_le_bytes().repeat(12)));
        image
    }

    fn text(&mut self, tag: Tag, text: &str) -> &mut Self {
        self.0.insert(tag, ("LO", text.as_bytes().to_vec()));
        self
    }

    fn short(&mut self, tag: Tag, number: u16) -> &mut Self {
        self.0.insert(tag, ("US", number.to_le_bytes().to_vec()));
        self
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
            bytes.resize(bytes.len() + value.len() % 2, if *vr == "UI" { 0 } else { b' ' });
        }
        bytes
    }
}

/// A folder of images by their names.
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
        .map(|k| (format!("{k}.dcm"), Image::new("1.5", "CT", 100.0 + 3.0 * f64::from(k))))
        .collect()
}

fn complaint(images: Vec<(String, Image)>) -> String {
    let error = read_series(folder(images).path()).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    error.to_string()
}

#[test]
fn a_series_that_is_no_volume_is_named_with_the_file() {
    let good = read_series(folder(series()).path()).unwrap();
    assert_eq!(good.grid().size, [4, 3, 5]);
    assert_eq!(good.grid().spacing_mm, DVec3::new(1.5, 1.5, 3.0));
    assert_eq!(good.voxels(), &Voxels::I16(vec![-1000; 60]));

    type Change = fn(&mut Vec<(String, Image)>);
    let cases: [(Change, &str); 16] = [
        (|s| drop(s.remove(2)), "3.dcm: a slice missing between it and "),
        (|s| drop(s.drain(1..4)), "two or more"),
        (
            |s| {
                let z = "-10\\20\\160";
                s[4].1.text((0x20, 0x32), z);
            },
            "4.dcm: 16 slices missing between it and ",
        ),
        (
            |s| {
                s[4].1.text((0x20, 0x32), "-10\\20\\113.3");
            },
            "4.dcm: a distance of 4.300 mm between it and ",
        ),
        (|s| s.push(("again.dcm".into(), s[1].1.clone())), "again.dcm: a second slice at the place of "),
        (
            |s| {
                s[3].1.text((0x20, 0x32), "-10\\21.5\\109");
            },
            "3.dcm: a slice 1.500 mm beside that of ",
        ),
        (
            |s| {
                for (k, (_, image)) in s.iter_mut().enumerate() {
                    image.text((0x20, 0x32), &format!("-10\\{}\\{}", 20 + k, 100 + 3 * k));
                    image.text((0x18, 0x1120), "18.4");
                }
            },
            "1.dcm: a slice 1.000 mm beside that of ",
        ),
        (
            |s| {
                s[2].1.text((0x20, 0x0E), "1.6");
            },
            "2.dcm: series `CT` (1.6); allowed: one series: ",
        ),
        (
            |s| {
                s[2].1.text((0x20, 0x52), "1.99");
            },
            "2.dcm: frame of reference 1.99; allowed: the frame of reference of ",
        ),
        (
            |s| {
                s[2].1.text((0x10, 0x20), "P02");
            },
            "2.dcm: patient P02",
        ),
        (
            |s| {
                s[2].1.short((0x28, 0x10), 2);
            },
            "2.dcm: size 4 x 2 pixels; allowed: the size of ",
        ),
        (
            |s| {
                s[2].1.text((0x28, 0x30), "1.5\\1.6");
            },
            "2.dcm: pixel spacing 1.6 x 1.5 mm",
        ),
        (
            |s| {
                s[2].1.text((0x20, 0x37), "1\\0\\0\\0\\0.8\\0.6");
            },
            "2.dcm: orientation ",
        ),
        (
            |s| {
                s[2].1.text((0x08, 0x16), "1.2.840.10008.5.1.4.1.1.481.3");
            },
            "2.dcm: SOPClassUID (0008,0016): an RT Structure Set; allowed: CT Image Storage",
        ),
        (
            |s| {
                s[2].1.text((0x08, 0x16), "1.2.3");
            },
            "class `1.2.3`",
        ),
        (|s| s.clear(), "no file; allowed: CT images"),
    ];
    for (change, words) in cases {
        let mut images = series();
        change(&mut images);
        if words == "two or more" {
            images.truncate(1);
        }
        let found = complaint(images);
        assert!(found.contains(words), "{words}\n{found}");
    }
    // What is tilted says by how much.
    let mut tilted = series();
    tilted[4].1.text((0x20, 0x32), "-10\\22\\112").text((0x18, 0x1120), "18.4");
    assert!(complaint(tilted).contains("a gantry tilt of 18.4 deg"));
}

#[test]
fn an_image_that_is_none_of_ours_is_named_with_the_element() {
    let refused = |bytes: &[u8]| {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.dcm");
        std::fs::write(&path, bytes).unwrap();
        let error = read_slice(&path).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
        error.to_string()
    };
    let image = Image::new("1.5", "CT", 0.0);
    type Change = fn(&mut Image);
    let cases: [(Change, &str); 17] = [
        (|i| drop(i.short((0x28, 2), 3)), "SamplesPerPixel (0028,0002): 3; allowed: 1: grey"),
        (|i| drop(i.text((0x28, 8), "2")), "NumberOfFrames (0028,0008): 2; allowed: 1"),
        (|i| drop(i.short((0x28, 0x100), 8)), "BitsAllocated (0028,0100): 8; allowed: 16"),
        (|i| drop(i.short((0x28, 0x101), 17)), "BitsStored (0028,0101): 17"),
        (|i| drop(i.short((0x28, 0x102), 15)), "HighBit (0028,0102): 15; allowed: 11"),
        (|i| drop(i.short((0x28, 0x103), 2)), "PixelRepresentation (0028,0103): 2"),
        (|i| drop(i.text((0x28, 0x103), "abc")), "4 bytes; allowed: an unsigned short"),
        (|i| drop(i.text((0x28, 0x1053), "0")), "RescaleSlope (0028,1053): 0, with"),
        (|i| drop(i.text((0x28, 0x30), "1.5")), "PixelSpacing (0028,0030): `1.5`; allowed: 2 numbers"),
        (|i| drop(i.text((0x28, 0x30), "1.5\\-1")), "1.5 and -1 mm; allowed: distances above 0"),
        (|i| drop(i.text((0x28, 0x30), "1.5\\1e999")), "`1.5\\1e999`; allowed: 2 numbers"),
        (|i| drop(i.0.remove(&(0x28, 0x30))), "PixelSpacing (0028,0030): nothing"),
        (|i| drop(i.text((0x20, 0x32), "1\\2\\3\\4")), "ImagePositionPatient (0020,0032): `1\\2\\3\\4`"),
        (|i| drop(i.text((0x20, 0x37), "1\\0\\0\\1\\0\\0")), "two orthogonal directions"),
        (|i| drop(i.short((0x28, 0x11), 5)), "PixelData (7FE0,0010): 24 bytes; allowed: 5 x 3 pixels"),
        (|i| drop(i.short((0x28, 0x11), 0)), "0 x 3 pixels"),
        (|i| drop(i.0.remove(&(0x18, 0x50))), "no SliceThickness (0018,0050)"),
    ];
    for (change, words) in cases {
        let mut other = image.clone();
        change(&mut other);
        let found = refused(&other.bytes());
        assert!(found.contains(words), "{words}\n{found}");
    }
    for (syntax, words) in [
        ("1.2.840.10008.1.2.4.70", "JPEG lossless, first-order prediction; allowed: implicit or"),
        ("1.2.840.10008.1.2.2", "explicit VR big endian; allowed"),
        ("1.2.3", "`1.2.3`; allowed"),
    ] {
        let found = refused(&image.of_syntax(syntax));
        assert!(found.contains(words), "{found}");
    }
    let bytes = image.bytes();
    assert!(refused(b"II*\0").contains("no `DICM` after 128 bytes, 4 in all"));
    assert!(refused(&bytes[..bytes.len() - 1]).contains("23 bytes left; allowed: 24, as declared"));
    // Pixels in fragments, in a file that says they were none.
    let at = bytes.len() - 24;
    let mut fragments = bytes[..at - 4].to_vec();
    fragments.extend([0xFF; 4]);
    assert!(refused(&fragments).contains("compressed pixels"));
    // A length of four gigabytes, and sequences in each other without end.
    let mut long = bytes[..at - 4].to_vec();
    long.extend(0xFFFF_FFF0_u32.to_le_bytes());
    assert!(refused(&long).contains("0 bytes left; allowed: 4294967280, as declared"));
    let mut deep = bytes[..at - 12].to_vec();
    for _ in 0..100_000 {
        deep.extend([8, 0, 0x40, 0x11, b'S', b'Q', 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
        deep.extend([0xFE, 0xFF, 0, 0xE0, 0xFF, 0xFF, 0xFF, 0xFF]);
    }
    assert!(refused(&deep).contains("more than 64 sequences in each other"));
    let mut stray = bytes;
    stray.extend([0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]);
    assert!(refused(&stray).contains("a delimiter of nothing"));
}

/// Ten series of three slices, a phase each, whose numbers tell it; and what an average is.
fn four_d(describe: impl Fn(u32) -> String) -> Vec<(String, Image)> {
    let mut images = Vec::new();
    for phase in 0..10_u32 {
        for k in 0..3 {
            // Identifiers in another order than the phases.
            let series = format!("1.5.{}", (phase * 7) % 10);
            let mut image = Image::new(&series, &describe(10 * phase), 3.0 * f64::from(k));
            let pixels = (1024 + phase as u16).to_le_bytes().repeat(12);
            image.0.insert((0x7FE0, 0x10), ("OW", pixels));
            images.push((format!("{phase}/{k}"), image));
        }
    }
    images
}

fn check_ten(dir: &Path) -> Phases {
    let phases = Phases::open(dir).unwrap();
    let percents: Vec<f64> = phases.percents().collect();
    let exact: Vec<f64> = (0..10).map(|n| 10.0 * f64::from(n)).collect();
    assert_eq!(percents, exact);
    for n in 0..10 {
        let volume = phases.volume(n).unwrap();
        assert_eq!(volume.grid(), phases.grid());
        assert_eq!(volume.voxels(), &Voxels::I16(vec![n as i16; 36]));
    }
    phases
}

#[test]
fn phases_are_told_by_what_the_series_are_called() {
    check_ten(folder(four_d(|p| format!("Gated, {p}.0%A"))).path());
    let mut images = four_d(|p| format!("T={p}%"));
    for k in 0..3 {
        let average = Image::new("1.6", "Average", 3.0 * f64::from(k));
        images.push((format!("average/{k}"), average));
    }
    let dir = folder(images);
    // What a program of a scanner leaves there.
    std::fs::write(dir.path().join("DICOMDIR"), b"no image").unwrap();
    std::fs::write(dir.path().join(".hidden"), b"no image").unwrap();
    let phases = check_ten(dir.path());
    assert_eq!(phases.left_out(), ["`Average` (1.6), 3 images"]);
}

#[test]
fn phases_are_told_by_what_the_images_say() {
    // One series for all: nominal percentage, temporal position, trigger time.
    let with = |change: fn(&mut Image, u32)| {
        let mut images = four_d(|_| "4D".to_owned());
        for (name, image) in &mut images {
            let phase = name[..1].parse().unwrap();
            image.text((0x20, 0x0E), "1.5");
            change(image, phase);
        }
        folder(images)
    };
    let nominal = |image: &mut Image, phase: u32| {
        let value = (10.0 * f64::from(phase)).to_le_bytes().to_vec();
        image.0.insert((0x20, 0x9241), ("FD", value));
    };
    check_ten(with(nominal).path());
    check_ten(with(|image, n| drop(image.text((0x20, 0x100), &format!("{}", n + 1)))).path());
    check_ten(with(|image, n| drop(image.text((0x18, 0x1060), &format!("{}", 390 * n)))).path());
    let none = Phases::open(with(|_, _| ()).path()).unwrap_err().to_string();
    assert!(none.contains("one series that says no phases"), "{none}");
}

#[test]
fn phases_that_do_not_match_are_named() {
    let complaint = |change: &dyn Fn(&mut Vec<(String, Image)>)| {
        let mut images = four_d(|p| format!("T{p}"));
        change(&mut images);
        Phases::open(folder(images).path()).unwrap_err().to_string()
    };
    let short = complaint(&|s| s.retain(|(name, _)| name != "4/2"));
    assert!(short.contains("phase 40 %: 4 x 3 x 2 voxels; allowed: as phase 0 % of "), "{short}");
    let frame = complaint(&|s| {
        for (name, image) in s {
            if name.starts_with('7') {
                image.text((0x20, 0x52), "1.99");
            }
        }
    });
    assert!(frame.contains("phase 70 %: frame of reference 1.99"), "{frame}");
    let twice = complaint(&|s| {
        for (name, image) in s {
            if name.starts_with('7') {
                image.text((0x08, 0x103E), "T 30");
            }
        }
    });
    assert!(twice.contains("a second phase at 30 %: `T 30`"), "{twice}");
    let unnamed = complaint(&|s| {
        for (_, image) in s {
            image.text((0x08, 0x103E), "CT");
        }
    });
    assert!(unnamed.contains("series without a phase: `CT` (1.5.0), 3 images; "), "{unnamed}");
    let missing = complaint(&|s| s.retain(|(name, _)| name != "4/1"));
    assert!(missing.contains("voxels; allowed"), "{missing}");
}

#[test]
fn descriptions_say_a_phase_or_none() {
    for (text, percent) in [
        ("T=50%", Some(50.0)),
        ("Gated, 0.0%A", Some(0.0)),
        ("P4^P100^S100^I00003, Gated, 90.0%B", Some(90.0)),
        ("4D 100 % ex", Some(100.0)),
        ("T30", Some(30.0)),
        ("CT_T=20", Some(20.0)),
        ("Resp T_70 b", Some(70.0)),
        ("Phase 40", Some(40.0)),
        ("phase=5", Some(5.0)),
        ("Average", None),
        ("CT 50", None),
        ("T12a", None),
        ("ä%", None),
        ("%", None),
        ("", None),
    ] {
        assert_eq!(in_words(text), percent, "{text}");
    }
}
