//! Invalid and unsupported images and series, each with its error message.

use super::*;

/// A modification of the images in a folder.
type Change = fn(&mut Vec<(String, Image)>);

fn complaint(images: Vec<(String, Image)>) -> String {
    let error = read_series(folder(images).path()).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    error.to_string()
}

#[test]
fn refuses_series_that_is_no_volume_and_names_the_file() {
    let good = read_series(folder(series()).path()).unwrap();
    assert_eq!(good.grid().size, [4, 3, 5]);
    assert_eq!(good.grid().spacing_mm, DVec3::new(1.5, 1.5, 3.0));
    assert_eq!(good.voxels(), &Voxels::I16(vec![-1000; 60]));

    let cases: [(Change, &str); 17] = [
        (
            |s| drop(s.remove(2)),
            "3.dcm: a slice missing between it and ",
        ),
        (|s| drop(s.drain(1..4)), "two or more"),
        (
            |s| {
                drop((s.remove(3), s.remove(1)));
                for (_, image) in s.iter_mut() {
                    image.text((0x18, 0x50), "3");
                }
            },
            "0.dcm: slices of 3 mm every 6.000 mm: some are missing; expected ",
        ),
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
        (
            |s| s.push(("again.dcm".into(), s[1].1.clone())),
            "again.dcm: a second slice at the position of ",
        ),
        (
            |s| {
                s[3].1.text((0x20, 0x32), "-10\\21.5\\109");
            },
            "3.dcm: a slice shifted sideways by 1.500 mm from that of ",
        ),
        (
            |s| {
                for (k, (_, image)) in s.iter_mut().enumerate() {
                    image.text((0x20, 0x32), &format!("-10\\{}\\{}", 20 + k, 100 + 3 * k));
                    image.text((0x18, 0x1120), "18.4");
                }
            },
            "1.dcm: a slice shifted sideways by 1.000 mm from that of ",
        ),
        (
            |s| {
                s[2].1.text((0x20, 0x0E), "1.6");
            },
            "2.dcm: series `CT` (1.6); expected one series: ",
        ),
        (
            |s| {
                s[2].1.text((0x20, 0x52), "1.99");
            },
            "2.dcm: frame of reference 1.99; expected the frame of reference of ",
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
            "2.dcm: size 4 x 2 pixels; expected the size of ",
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
            "2.dcm: SOPClassUID (0008,0016): an RT Structure Set; expected CT Image Storage",
        ),
        (
            |s| {
                s[2].1.text((0x08, 0x16), "1.2.3");
            },
            "class `1.2.3`",
        ),
        (|s| s.clear(), "no file; expected CT images"),
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
    // The message for a tilted series states the angle.
    let mut tilted = series();
    let image = &mut tilted[4].1;
    image.text((0x20, 0x32), "-10\\22\\112");
    image.text((0x18, 0x1120), "18.4");
    assert!(complaint(tilted).contains("a gantry tilt of 18.4 deg"));
}

#[test]
fn refuses_unsupported_image_and_names_the_element() {
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
        (
            |i| i.short((0x28, 2), 3),
            "SamplesPerPixel (0028,0002): 3; expected 1: grey",
        ),
        (
            |i| i.text((0x28, 8), "2"),
            "NumberOfFrames (0028,0008): 2; expected 1",
        ),
        (
            |i| i.short((0x28, 0x100), 8),
            "BitsAllocated (0028,0100): 8; expected 16",
        ),
        (|i| i.short((0x28, 0x101), 17), "BitsStored (0028,0101): 17"),
        (
            |i| i.short((0x28, 0x102), 15),
            "HighBit (0028,0102): 15; expected 11",
        ),
        (
            |i| i.short((0x28, 0x103), 2),
            "PixelRepresentation (0028,0103): 2",
        ),
        (
            |i| i.text((0x28, 0x103), "abc"),
            "4 bytes; expected an unsigned short",
        ),
        (
            |i| i.text((0x28, 0x1053), "0"),
            "RescaleSlope (0028,1053): 0, with",
        ),
        (
            |i| i.text((0x28, 0x30), "1.5"),
            "PixelSpacing (0028,0030): `1.5`; expected 2 numbers",
        ),
        (
            |i| i.text((0x28, 0x30), "1.5\\-1"),
            "1.5 and -1 mm; expected distances above 0",
        ),
        (
            |i| i.text((0x28, 0x30), "1.5\\1e999"),
            "`1.5\\1e999`; expected 2 numbers",
        ),
        (
            |i| drop(i.0.remove(&(0x28, 0x30))),
            "PixelSpacing (0028,0030): nothing",
        ),
        (
            |i| i.text((0x20, 0x32), "1\\2\\3\\4"),
            "ImagePositionPatient (0020,0032): `1\\2\\3\\4`",
        ),
        (
            |i| i.text((0x20, 0x37), "1\\0\\0\\1\\0\\0"),
            "two orthogonal directions",
        ),
        (
            |i| i.short((0x28, 0x11), 5),
            "PixelData (7FE0,0010): 24 bytes; expected 5 x 3 pixels",
        ),
        (|i| i.short((0x28, 0x11), 0), "0 x 3 pixels"),
        (
            |i| drop(i.0.remove(&(0x18, 0x50))),
            "no SliceThickness (0018,0050)",
        ),
    ];
    for (change, words) in cases {
        let mut other = image.clone();
        change(&mut other);
        let found = refused(&other.bytes());
        assert!(found.contains(words), "{words}\n{found}");
    }
    for (syntax, words) in [
        (
            "1.2.840.10008.1.2.4.70",
            "JPEG lossless, first-order prediction; expected implicit or",
        ),
        ("1.2.840.10008.1.2.2", "explicit VR big endian; expected"),
        ("1.2.3", "`1.2.3`; expected"),
    ] {
        let found = refused(&image.of_syntax(syntax));
        assert!(found.contains(words), "{found}");
    }
    let bytes = image.bytes();
    assert!(refused(b"II*\0").contains("no `DICM` after 128 bytes, 4 in all"));
    assert!(refused(&bytes[..bytes.len() - 1]).contains("23 bytes left; expected 24, as declared"));
    // Fragmented (compressed) pixels in a file that declares uncompressed pixels.
    let at = bytes.len() - 24;
    let mut fragments = bytes[..at - 4].to_vec();
    fragments.extend([0xFF; 4]);
    assert!(refused(&fragments).contains("compressed pixels"));
    // A length of four gigabytes, and deeply nested sequences.
    let mut long = bytes[..at - 4].to_vec();
    long.extend(0xFFFF_FFF0_u32.to_le_bytes());
    assert!(refused(&long).contains("0 bytes left; expected 4294967280, as declared"));
    let mut deep = bytes[..at - 12].to_vec();
    for _ in 0..100_000 {
        deep.extend([8, 0, 0x40, 0x11, b'S', b'Q', 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
        deep.extend([0xFE, 0xFF, 0, 0xE0, 0xFF, 0xFF, 0xFF, 0xFF]);
    }
    assert!(refused(&deep).contains("more than 64 nested sequences"));
    let mut stray = bytes;
    stray.extend([0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]);
    assert!(refused(&stray).contains("a delimiter outside a sequence"));
}
