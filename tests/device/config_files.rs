//! Profiles, scenes and manifests with mistakes: each gives one message with the line, the text
//! found and the texts allowed. No text makes a parser panic.

use phasmid::geometry::Rig;
use phasmid::patient::phantom::Patient;
use phasmid::pattern::Manifest;
use phasmid::profile::faults::Schedule;
use phasmid::profile::{Profile, Scene, Station, TomlSource, profile_names, scene_names};
use proptest::prelude::*;

const BENCH: &str = include_str!("../../device-profiles/pmp-bench.toml");
const SPHERE: &str = include_str!("../../device-profiles/scenes/sphere.toml");

/// Returns the error of a text in which `from` is replaced by `to`, and the line of the replacement.
fn broken<T>(
    text: &str,
    from: &str,
    to: &str,
    parse: impl Fn(&str, &str) -> phasmid::Result<T>,
) -> (String, usize) {
    let at = text
        .find(from)
        .unwrap_or_else(|| panic!("{from} is not in the file"));
    let line = 1 + text[..at].matches('\n').count();
    match parse(&text.replacen(from, to, 1), "file.toml") {
        Ok(_) => panic!("{to} was accepted"),
        Err(error) => {
            assert_eq!(error.exit_code(), 2, "{error}");
            (error.to_string(), line)
        }
    }
}

/// The message names the line that enables the data line, whatever other option conflicts with the
/// data line.
#[test]
fn data_line_refuses_narrow_images_and_long_exposures() {
    for (from, to, needles) in [
        (
            "width_px = 1138",
            "width_px = 255",
            ["255 columns", "256 or more"],
        ),
        (
            "exposure_range_us = [20.0, 1000000.0]",
            "exposure_range_us = [20.0, 4294968.0]",
            ["4294968", "4294967.295"],
        ),
    ] {
        let (message, _) = broken(BENCH, from, to, Profile::parse);
        assert!(message.contains("camera.data_line"), "{message}");
        for needle in needles {
            assert!(message.contains(needle), "{needle:?} is not in: {message}");
        }
    }
}

#[test]
fn impossible_profiles_are_refused_with_line_and_range() {
    for (from, to, needles) in [
        (
            "exposure_us = 8000.0",
            "exposure_us = -8000.0",
            vec!["camera.exposure_us", "-8000", "20 to 1000000"],
        ),
        (
            "exposure_us = 8000.0",
            "exposure_us = nan",
            vec!["NaN", "20 to 1000000"],
        ),
        (
            "position_mm = [400.0, 0.0, 0.0]",
            "position_mm = [0.0, 0.0, 0.0]",
            vec!["projector.position_mm", "zero baseline"],
        ),
        (
            "width_px = 1138",
            "width_px = 0",
            vec!["camera.width_px", "8 to 32768"],
        ),
        ("width_px = 1138", "width_px = 11.5", vec!["11.5"]),
        (
            "read_noise_e = 2.3",
            "dark_current_e_s = -1\nread_noise_e = 2.3",
            vec!["camera.sensor.dark_current_e_s", "-1", "0 to 10000000"],
        ),
        (
            "read_noise_e = 2.3",
            "prnu_percent = 51\nread_noise_e = 2.3",
            vec!["camera.sensor.prnu_percent", "51", "0 to 50"],
        ),
        (
            "read_noise_e = 2.3",
            "dsnu_e = nan\nread_noise_e = 2.3",
            vec!["camera.sensor.dsnu_e", "NaN"],
        ),
        (
            "read_noise_e = 2.3",
            "blooming_percent = 101\nread_noise_e = 2.3",
            vec!["camera.sensor.blooming_percent", "101", "0 to 100"],
        ),
        (
            "read_noise_e = 2.3",
            "response = { kind = \"gamma\", gamma = 0 }\nread_noise_e = 2.3",
            vec!["camera.sensor.response.gamma", "0.25 to 4"],
        ),
        (
            "read_noise_e = 2.3",
            "response = { kind = \"linear\", gamma = 2.2 }\nread_noise_e = 2.3",
            vec!["unknown field"],
        ),
        (
            "f_number = 16.0",
            "glare = { percent = 5, sigma_px = 3 }\nf_number = 16.0",
            vec!["camera.glare.sigma_px", "32 to 32768"],
        ),
        (
            "width_px = 1138",
            "wdith_px = 1138",
            vec!["wdith_px", "unknown field"],
        ),
        (
            "format = \"GREY\"",
            "format = \"RGB3\"",
            vec!["RGB3", "GREY"],
        ),
        (
            "data_line = true",
            "data_line = 1",
            vec!["invalid type", "boolean"],
        ),
        (
            "bits = 8\n\n[projector]",
            "bits = 12\n\n[projector]",
            vec!["camera.sensor.bits", "expected 8"],
        ),
        (
            "f_number = 16.0",
            "f_number = 0.0",
            vec!["camera.f_number", "0.5 to 128"],
        ),
        (
            "f_number = 16.0",
            "focus_mm = 5.0\nf_number = 16.0",
            vec!["camera.focus_mm", "20 to 1000000000"],
        ),
        (
            "f_number = 16.0",
            "line_time_us = -1.0\nf_number = 16.0",
            vec!["camera.line_time_us", "-1", "0 to 1000"],
        ),
        (
            "frame_interval_us = 20000.0",
            "line_time_us = nan\nframe_interval_us = 20000.0",
            vec!["camera.line_time_us", "NaN"],
        ),
        (
            "full_well_e = 10500.0",
            "full_well_e = inf",
            vec!["full_well_e", "inf"],
        ),
        (
            "throw_ratio = 1.433",
            "throw_ratio = -1.0",
            vec!["projector.throw_ratio", "0.05 to 100"],
        ),
        (
            "period_us = 10000.0",
            "period_us = 1000.0",
            vec!["sequence[0].period_us", "8000 to"],
        ),
        (
            "name = \"pmp-bench\"",
            "name = \"pmp bench\"",
            vec!["name", "letters"],
        ),
        (
            "manufacturer = \"Phasmid\"",
            "manufacturer = \"a,b\"",
            vec!["identity.manufacturer", "comma"],
        ),
        (
            "lens_shift_px = [1100.5, 0.0]",
            "distortion = [-5.0, 0.0, 0.0, 0.0, 0.0]",
            vec!["projector.distortion", "folds over"],
        ),
        (
            "data_line = true",
            "distortion = [-9.15, -12.78, 0.0, 0.0, 285.2]",
            vec!["camera.distortion", "folds over"],
        ),
        (
            "lens_shift_px = [1100.5, 0.0]",
            "contrast_ratio = 0.5",
            vec!["projector.contrast_ratio", "1 to 1"],
        ),
        (
            "lens_shift_px = [1100.5, 0.0]",
            "response = { gamma = 0.0 }",
            vec!["projector.response.gamma", "0.1 to 10"],
        ),
        (
            "lens_shift_px = [1100.5, 0.0]",
            "response = { table = [0.0, 0.3, 0.9] }",
            vec!["projector.response.table", "0.9 at full white"],
        ),
        (
            "lens_shift_px = [1100.5, 0.0]",
            "response = { table = [1.0] }",
            vec!["projector.response.table", "2 to 4096"],
        ),
        (
            "lens_shift_px = [1100.5, 0.0]",
            "vignetting = { falloff = [-1.2, 0.0, 0.0] }",
            vec!["projector.vignetting.falloff", "half diagonals"],
        ),
        (
            "lens_shift_px = [1100.5, 0.0]",
            "focus = { distance_mm = 0.0, aperture_mm = 5.0 }",
            vec!["projector.focus.distance_mm", "1 to 10000000"],
        ),
    ] {
        let (message, line) = broken(BENCH, from, to, Profile::parse);
        for needle in needles {
            assert!(message.contains(needle), "{needle:?} is not in: {message}");
        }
        // A message about a `field = value` line usually names that line; other messages may name
        // the line of the enclosing table.
        let line_named = message.contains(&format!("file.toml:{line}"));
        assert!(line_named || message.contains("file.toml:"), "{message}");
        if from.contains('=') && !to.contains("wdith") && !to.contains("bits") {
            assert!(line_named, "line {line} is not in: {message}");
        }
    }
}

/// Frame intervals and sequence periods cannot be shorter than the readout of a rolling-shutter
/// frame, which takes one line time per row.
#[test]
fn rows_have_to_be_read_before_the_next_exposure() {
    let with = |line_time_us: &str, from: &str, to: &str| {
        let line = format!("f_number = 16.0\nline_time_us = {line_time_us}");
        let text = BENCH.replacen("f_number = 16.0", &line, 1);
        Profile::parse(&text.replacen(from, to, 1), "file.toml")
    };
    // The readout of 489 rows takes 9.78 ms at 20 us per row and 9.99956 ms at 20.449 us per row;
    // both fit in the sequence's period of 10 ms.
    for line_time_us in ["20.0", "20.449"] {
        with(line_time_us, "", "").unwrap();
    }
    let message = with("20.45", "", "").unwrap_err().to_string();
    assert!(
        message.contains("sequence[0].period_us") && message.contains("10000.05 to"),
        "{message}"
    );
    let message = with("41.0", "", "").unwrap_err().to_string();
    assert!(
        message.contains("camera.frame_interval_us") && message.contains("20049 to"),
        "{message}"
    );
    // The data line contains the time at which the last row's exposure ends, so the delay of that
    // row counts towards the limit.
    let range = "exposure_range_us = [20.0, 1000000.0]";
    let message = with("10", range, "exposure_range_us = [20.0, 4290088]")
        .unwrap_err()
        .to_string();
    assert!(message.contains("4290087.295"), "{message}");
}

#[test]
fn a_gray_code_too_short_for_its_fringes_is_refused() {
    let text = BENCH.replace("bits = 7,", "bits = 6,");
    let message = Profile::parse(&text, "file.toml").unwrap_err().to_string();
    assert!(
        message.contains("6 bits of 16 px") && message.contains("at least 7 bits"),
        "{message}"
    );
    let line = 1 + text[..text.find("frame = [").unwrap()]
        .matches('\n')
        .count();
    assert!(
        message.contains(&format!("file.toml:{line}: sequence[0].frame")),
        "{message}"
    );
}

#[test]
fn impossible_scenes_are_refused_with_line_and_range() {
    for (from, to, needles) in [
        (
            "radius_mm = 75.0",
            "radius_mm = 0.0",
            vec!["object[1].shape.radius_mm", "0"],
        ),
        (
            "albedo = 0.6",
            "albedo = 1.2",
            vec!["object[1].albedo", "0 to 1"],
        ),
        (
            "albedo = 0.6",
            "skin = { fitzpatrick = 7 }\nalbedo = 0.6",
            vec!["object[1].skin.fitzpatrick", "7", "1 to 6"],
        ),
        (
            "albedo = 0.6",
            "skin = { fitzpatrick = 2, absorption_per_mm = 0.1 }\nalbedo = 0.6",
            vec!["object[1].skin", "a class and coefficients"],
        ),
        (
            "albedo = 0.6",
            "skin = { absorption_per_mm = 0.1 }\nalbedo = 0.6",
            vec!["object[1].skin", "one coefficient of two"],
        ),
        (
            "albedo = 0.6",
            "skin = {}\nalbedo = 0.6",
            vec!["object[1].skin", "neither a class"],
        ),
        (
            "albedo = 0.6",
            "skin = { absorption_per_mm = nan, reduced_scattering_per_mm = 2 }\nalbedo = 0.6",
            vec!["object[1].skin.absorption_per_mm", "0.001 to 100"],
        ),
        (
            "albedo = 0.6",
            "skin = { absorption_per_mm = 0.1, reduced_scattering_per_mm = 0 }\nalbedo = 0.6",
            vec!["object[1].skin.reduced_scattering_per_mm", "0.1 to 10000"],
        ),
        (
            "albedo = 0.6",
            "skin = { fitzpatrick = 2, refractive_index = 0.9 }\nalbedo = 0.6",
            vec!["object[1].skin.refractive_index", "1 to 1.6"],
        ),
        (
            "albedo = 0.6",
            "skin = { fitzpatrick = 2, tone = 3 }\nalbedo = 0.6",
            vec!["tone", "unknown field"],
        ),
        (
            "kind = \"sphere\"",
            "kind = \"ball\"",
            vec!["ball", "sphere"],
        ),
        (
            "irradiance_w_m2 = 0.02",
            "irradiance_w_m2 = -1",
            vec!["ambient.irradiance_w_m2"],
        ),
        ("[0.0, 0.0, 940.0]", "[0.0, 0.0]", vec!["file.toml"]),
        (
            "albedo = 0.6",
            "motion = { keyframes = [{ time_s = 0.0 }] }\nalbedo = 0.6",
            vec!["object[1].motion.keyframes", "1 keyframes", "2 to 4096"],
        ),
        (
            "albedo = 0.6",
            "motion = { keyframes = [{ time_s = 1.0 }, { time_s = 1.0 }] }\nalbedo = 0.6",
            vec![
                "motion.keyframes[1].time_s",
                "1 after 1",
                "1e-6 s or more apart",
            ],
        ),
        (
            "albedo = 0.6",
            "motion = { keyframes = [{ time_s = -1.0 }, { time_s = 1.0 }] }\nalbedo = 0.6",
            vec!["motion.keyframes[0].time_s", "-1", "0 to 1000000000"],
        ),
        (
            "albedo = 0.6",
            "motion = { period_s = 2.0, keyframes = [{ time_s = 1.0 }, { time_s = 3.0 }] }\n\
             albedo = 0.6",
            vec![
                "object[1].motion.period_s",
                "2 for keyframes over 2 s",
                "more than",
            ],
        ),
        (
            "albedo = 0.6",
            "motion = { keyframes = [{ time_s = 0 }, { time_s = 1, position_mm = [0, nan, 0] }] }\n\
             albedo = 0.6",
            vec!["motion.keyframes[1].position_mm", "NaN"],
        ),
        (
            "albedo = 0.6",
            "motion = { keyframes = [{ time_s = 0 }, { time_s = 1, turn_deg = 5 }] }\nalbedo = 0.6",
            vec!["turn_deg", "unknown field"],
        ),
        (
            "albedo = 0.6",
            "motion = { keyframes = [{ time_s = 0 }, { time_s = 1, rotation_deg = [0, 400, 0] }] }\n\
             albedo = 0.6",
            vec!["motion.keyframes[1].rotation_deg", "-360 to 360"],
        ),
        (
            "albedo = 0.6",
            "deform = { keyframes = [{ time_s = 0, file = \"a.ply\" }, \
             { time_s = 1, file = \"b.ply\" }] }\nalbedo = 0.6",
            vec![
                "object[1].deform",
                "without triangles",
                "a torso, a couch or a mesh",
            ],
        ),
        (
            "name = \"sphere\"",
            "rig = { position_mm = [0.0, 2e9, 0.0] }\nname = \"sphere\"",
            vec!["rig.position_mm", "-1000000000 to 1000000000"],
        ),
        (
            "name = \"sphere\"",
            "interreflection = { samples = 63 }\nname = \"sphere\"",
            vec![
                "interreflection.samples: 63",
                "multiple of 16 from 16 to 1024",
            ],
        ),
        (
            "name = \"sphere\"",
            "interreflection = { samples = 2048 }\nname = \"sphere\"",
            vec!["interreflection.samples: 2048"],
        ),
        (
            "name = \"sphere\"",
            "interreflection = { samples = 64, step_px = 0 }\nname = \"sphere\"",
            vec!["interreflection.step_px: 0", "1 to 64"],
        ),
        (
            "name = \"sphere\"",
            "rig = { rotation_deg = [0.0, 0.0, nan] }\nname = \"sphere\"",
            vec!["rig.rotation_deg", "-360 to 360"],
        ),
        (
            "[0.0, 0.0, 940.0]",
            "[0.0, 0.0, inf]",
            vec!["object[1].position_mm", "inf"],
        ),
        (
            "radius_mm = 75.0",
            "radius_mm = 75.0, colour = 3",
            vec!["colour", "unknown field"],
        ),
    ] {
        let (message, line) = broken(SPHERE, from, to, Scene::parse);
        for needle in needles {
            assert!(message.contains(needle), "{needle:?} is not in: {message}");
        }
        assert!(
            message.contains(&format!("file.toml:{line}")),
            "line {line}: {message}"
        );
    }
}

#[test]
fn built_in_profiles_and_scenes_load() {
    for name in profile_names() {
        assert_eq!(Profile::load(name).unwrap().name, name);
    }
    for name in scene_names() {
        assert_eq!(Scene::load(name).unwrap().name, name);
    }
    let fringes_per_mm = 1.433 * 1920.0 / 1000.0 / 16.0;
    assert!((fringes_per_mm - 0.172f64).abs() < 5e-4);
}

/// Returns a text with a few of its bytes replaced, removed or doubled.
fn mutated(text: &'static str) -> impl Strategy<Value = String> {
    let edit = (0..text.len(), any::<u8>(), 0..3u8);
    proptest::collection::vec(edit, 1..8).prop_map(move |edits| {
        let mut bytes = text.as_bytes().to_vec();
        for (at, byte, how) in edits {
            let at = at.min(bytes.len() - 1);
            match how {
                0 => bytes[at] = byte & 0x7f,
                1 => drop(bytes.remove(at)),
                _ => bytes.insert(at, b"0123456789-.e[]{}\"\n"[usize::from(byte) % 19]),
            }
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn no_text_makes_a_reader_panic(text in "\\PC{0,200}") {
        let _ = Profile::parse(&text, "t");
        let _ = Scene::parse(&text, "t");
        let _ = Manifest::parse(&text, "t");
    }

    #[test]
    fn no_mutation_makes_a_reader_panic(profile in mutated(BENCH), scene in mutated(SPHERE)) {
        // A profile that is accepted after a mutation still meets its guarantees.
        if let Ok(profile) = Profile::parse(&profile, "t") {
            prop_assert!(profile.nominal_rig().projector.center().length() > 0.0);
            let manifest = profile.manifest(&profile.sequence[0]);
            let again = Manifest::parse(&manifest.to_toml(), "again");
            prop_assert_eq!(again.unwrap(), manifest);
        }
        let _ = Scene::parse(&scene, "t");
    }
}

#[test]
fn a_reader_that_leaves_ends_a_list_quietly() {
    let phasmid = env!("CARGO_BIN_EXE_phasmid");
    let line = format!("({phasmid} scene list 2>err.txt; true) | (exec 0<&-; sleep 0.3)");
    let folder = tempfile::tempdir().unwrap();
    let done = std::process::Command::new("sh")
        .args(["-c", &line])
        .current_dir(&folder)
        .output()
        .unwrap();
    assert!(done.status.success(), "{done:?}");
    let said = std::fs::read_to_string(folder.path().join("err.txt")).unwrap();
    assert_eq!(said, "", "no message about a closed pipe");
}

/// Checks that a list of numbers in a text cannot be made longer or shorter, since all lists have a
/// fixed length. Takes the text and its parsers; returns the number of lists.
fn no_list_may_be_longer_or_shorter(
    name: &str,
    text: &str,
    read: impl Fn(&str) -> phasmid::Result<()>,
) -> usize {
    read(text).unwrap();
    let is_list = |inside: &str| {
        let numbers: Vec<_> = inside.split(',').map(|n| n.trim().parse::<f64>()).collect();
        numbers.iter().all(Result::is_ok).then_some(numbers.len())
    };
    let mut lists = 0;
    for (start, _) in text.match_indices('[') {
        let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
        let end = start + text[start..].find(']').unwrap_or(0);
        let Some(count) = is_list(&text[start + 1..end]) else {
            continue;
        };
        if text[line_start..start].contains('#') {
            continue;
        }
        lists += 1;
        let line = 1 + text[..start].matches('\n').count();
        let numbers = &text[start + 1..end];
        let fewer = numbers.rsplit_once(',').map_or("", |(rest, _)| rest);
        for (numbers, found) in [
            (format!("{numbers}, 0"), count + 1),
            (fewer.into(), count - 1),
        ] {
            let other = [&text[..=start], &numbers, &text[end..]].concat();
            let words = read(&other).unwrap_err().to_string();
            let plural = if found == 1 { "" } else { "s" };
            let end = format!(": a list of {found} number{plural}; expected {count}");
            let start = format!("file.toml:{line}: ");
            assert!(
                words.starts_with(&start) && words.ends_with(&end),
                "{name}: {words}"
            );
        }
    }
    lists
}

#[test]
fn lists_of_numbers_have_the_length_that_they_have_everywhere() {
    const AT: &str = "file.toml";
    let mut lists = 0;
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("device-profiles");
    for folder in ["", "scenes", "stations", "faults", "patients"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            // The folder also contains the crate's own files.
            let of_the_crate = path.ends_with("Cargo.toml") || path.ends_with("lib.rs");
            if !path.is_file() || of_the_crate {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let name = path.display().to_string();
            lists += no_list_may_be_longer_or_shorter(&name, &text, |text| match folder {
                "" => Profile::parse(text, AT).map(drop),
                "scenes" => Scene::parse(text, AT).map(drop),
                "stations" => Station::parse(text, AT).map(drop),
                "patients" => Patient::parse(text, AT).map(drop),
                _ => Schedule::from_source(&TomlSource::new(text, AT)).map(drop),
            });
        }
    }
    assert!(lists >= 33, "{lists}");
    let rig = Profile::load("pmp-real").unwrap().nominal_rig().to_toml();
    let read = |text: &str| Rig::from_toml(text, AT).map(drop);
    // The 14 lists include the rows of the rotation matrices.
    assert_eq!(no_list_may_be_longer_or_shorter("rig", &rig, read), 14);
    let row = rig.find("rotation = [").unwrap();
    let end = row + rig[row..].find("],").unwrap();
    let two = [&rig[..row], "rotation = [", rig[end + 2..].trim_start()].concat();
    let words = read(&two).unwrap_err().to_string();
    assert!(words.ends_with("a list of 2 rows; expected 3"), "{words}");
}
