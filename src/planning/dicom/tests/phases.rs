//! All ways in which files state their phase.

use super::super::sorted::in_words;
use super::*;

/// Images with their file names.
type Images = Vec<(String, Image)>;

/// Ten series of three slices, one per phase; the pixel value encodes the phase.
fn four_d(describe: impl Fn(u32) -> String) -> Images {
    let mut images = Vec::new();
    for phase in 0..10_u32 {
        for k in 0..3 {
            // UIDs are not in the order of the phases.
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
fn phases_are_recognised_by_series_descriptions() {
    check_ten(folder(four_d(|p| format!("Gated, {p}.0%A"))).path());
    let mut images = four_d(|p| format!("T={p}%"));
    for k in 0..3 {
        let average = Image::new("1.6", "Average", 3.0 * f64::from(k));
        images.push((format!("average/{k}"), average));
    }
    let dir = folder(images);
    // Other files that scanner software leaves in such a folder.
    std::fs::write(dir.path().join("DICOMDIR"), b"no image").unwrap();
    std::fs::write(dir.path().join(".hidden"), b"no image").unwrap();
    let phases = check_ten(dir.path());
    assert_eq!(phases.left_out(), ["`Average` (1.6), 3 images"]);
}

#[test]
fn phases_are_recognised_by_image_elements() {
    // All phases in one series, divided by nominal percentage, temporal position or trigger time.
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
    check_ten(with(|image, n| image.text((0x20, 0x100), &format!("{}", n + 1))).path());
    check_ten(with(|image, n| image.text((0x18, 0x1060), &format!("{}", 390 * n))).path());
    let none = Phases::open(with(|_, _| ()).path())
        .unwrap_err()
        .to_string();
    assert!(none.contains("one series without phases"), "{none}");
}

#[test]
fn phases_that_do_not_match_are_refused_by_name() {
    let complaint = |change: fn(&mut Images)| {
        let mut images = four_d(|p| format!("T{p}"));
        change(&mut images);
        Phases::open(folder(images).path()).unwrap_err().to_string()
    };
    let short = complaint(|s| s.retain(|(name, _)| name != "4/2"));
    assert!(
        short.contains(
            "phase 40 %: 4 x 3 x 2 voxels; expected 4 x 3 x 3 voxels, as in phase 0 % of "
        ),
        "{short}"
    );
    let frame = complaint(|s| {
        for (name, image) in s {
            if name.starts_with('7') {
                image.text((0x20, 0x52), "1.99");
            }
        }
    });
    assert!(
        frame.contains("phase 70 %: frame of reference 1.99"),
        "{frame}"
    );
    let twice = complaint(|s| {
        for (name, image) in s {
            if name.starts_with('7') {
                image.text((0x08, 0x103E), "T 30");
            }
        }
    });
    assert!(twice.contains("a second phase at 30 %: `T 30`"), "{twice}");
    let unnamed = complaint(|s| {
        for (_, image) in s {
            image.text((0x08, 0x103E), "CT");
        }
    });
    assert!(
        unnamed.contains("series without a phase: `CT` (1.5.0), 3 images; "),
        "{unnamed}"
    );
    let missing = complaint(|s| s.retain(|(name, _)| name != "4/1"));
    assert!(
        missing.contains("slices of 3 mm every 6.000 mm: some are missing"),
        "{missing}"
    );
}

#[test]
fn the_reference_phase_is_the_one_that_is_asked_for() {
    let mut images = four_d(|p| format!("Gated, {p}.0%A"));
    for k in 0..3 {
        let average = Image::new("1.6", "Average", 3.0 * f64::from(k));
        images.push((format!("average/{k}"), average));
    }
    let dir = folder(images);
    let (volume, title) = read_reference(dir.path(), 70.0).unwrap();
    assert_eq!(volume.voxels(), &Voxels::I16(vec![7; 36]));
    assert_eq!(title, "`Gated, 70.0%A` (1.5.9)");
    let absent = read_reference(dir.path(), 75.0).unwrap_err().to_string();
    let words = "phases 0, 10, 20, 30, 40, 50, 60, 70, 80, 90 %, and `Average` (1.6), 3 images; \
                 expected phase 75 %";
    assert!(absent.contains(words), "{absent}");
    // A single series is taken as the reference phase unless its images state another.
    let (volume, _) = read_reference(folder(series()).path(), 50.0).unwrap();
    assert_eq!(volume.grid().size, [4, 3, 5]);
    let mut other = series();
    for (_, image) in &mut other {
        let value = 30.0_f64.to_le_bytes().to_vec();
        image.0.insert((0x20, 0x9241), ("FD", value));
    }
    let dir = folder(other);
    let found = read_reference(dir.path(), 50.0).unwrap_err().to_string();
    assert!(
        found.contains("phase 30 %: `CT` (1.5); expected phase 50 %"),
        "{found}"
    );
    read_reference(dir.path(), 30.0).unwrap();
    // Several series without a phase are ambiguous.
    let mut mixed = series();
    mixed[2].1.text((0x20, 0x0E), "1.6");
    let found = read_reference(folder(mixed).path(), 50.0)
        .unwrap_err()
        .to_string();
    let words =
        "series without a phase: `CT` (1.5), 4 images; `CT` (1.6), 1 images; expected one series";
    assert!(found.contains(words), "{found}");
}

#[test]
fn reads_phase_from_series_description() {
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
