//! `phasmid decode` as a user runs it: input files, output files, exit status and messages.

use image::{DynamicImage, GrayImage, ImageBuffer, Luma};
use std::f64::consts::TAU;
use std::path::Path;
use std::process::{Command, Output};

const SIZE: (u32, u32) = (64, 20);

/// Saves an image; a function returns the level, 0 to 1, of each pixel.
type Save<'a> = &'a dyn Fn(&Path, &dyn Fn(u32, u32) -> f64);

/// Returns the projector column of a pixel.
fn column(u: u32, v: u32) -> f64 {
    30.0 + 6.1 * f64::from(u) + 0.4 * f64::from(v)
}

/// Writes eight-step fringes whose single period covers the projector, as files 0.EXT to 7.EXT, and
/// their manifest.
fn write_sequence(folder: &Path, extension: &str, save: Save<'_>) {
    let mut text = "[projector]\nwidth_px = 480\nheight_px = 300\n".to_owned();
    for i in 0..8 {
        let phase = TAU * f64::from(i) / 8.0;
        let name = format!("{i}.{extension}");
        text += &format!(
            "[[frame]]\nfile = \"{name}\"\npattern = {{ kind = \"fringe\", axis = \"x\", \
             period_px = 500, phase_rad = {phase} }}\n"
        );
        let level = |u, v| 0.5 + 0.4 * (TAU * column(u, v) / 500.0 + phase).cos();
        save(&folder.join(name), &level);
    }
    // An image among the patterns that is not needed for decoding. Neither its file nor its
    // photograph is needed, and both are missing.
    text += "[[frame]]\nfile = \"gone.png\"\n\
             pattern = { kind = \"image\", file = \"speckle.png\" }\n";
    std::fs::write(folder.join("sequence.toml"), text).unwrap();
}

fn save_grey8(path: &Path, level: &dyn Fn(u32, u32) -> f64) {
    GrayImage::from_fn(SIZE.0, SIZE.1, |u, v| {
        Luma([(250.0 * level(u, v)).round() as u8])
    })
    .save(path)
    .unwrap();
}

fn phasmid(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .arg("decode")
        .args(args)
        .output()
        .unwrap()
}

fn refused(args: &[&str], needles: &[&str]) {
    let output = phasmid(args);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    for needle in needles {
        assert!(message.contains(needle), "{needle} not in: {message}");
    }
}

/// Returns the shape and values of a float32 array file.
fn read_npy(path: &Path) -> (String, Vec<f32>) {
    let bytes = std::fs::read(path).unwrap();
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = String::from_utf8(bytes[10..10 + length].to_vec()).unwrap();
    let values = bytes[10 + length..]
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect();
    (header, values)
}

#[test]
fn every_image_format_decodes_to_the_same_columns() {
    let save_grey16 = |path: &Path, level: &dyn Fn(u32, u32) -> f64| {
        ImageBuffer::from_fn(SIZE.0, SIZE.1, |u, v| {
            Luma([(60000.0 * level(u, v)).round() as u16])
        })
        .save(path)
        .unwrap();
    };
    let save_colour = |path: &Path, level: &dyn Fn(u32, u32) -> f64| {
        let grey = GrayImage::from_fn(SIZE.0, SIZE.1, |u, v| {
            Luma([(250.0 * level(u, v)).round() as u8])
        });
        DynamicImage::from(grey).to_rgb8().save(path).unwrap();
    };
    let kinds: [(&str, &str, Save<'_>); 5] = [
        ("grey8", "png", &save_grey8),
        ("grey16", "png", &save_grey16),
        ("colour", "png", &save_colour),
        ("bmp", "bmp", &save_grey8),
        ("tiff", "tiff", &save_grey16),
    ];
    let root = tempfile::tempdir().unwrap();
    for (name, extension, save) in kinds {
        let (frames, out) = (
            root.path().join(name),
            root.path().join(format!("{name}-out")),
        );
        std::fs::create_dir(&frames).unwrap();
        write_sequence(&frames, extension, save);
        let manifest = frames.join("sequence.toml");
        let (manifest, out_text) = (manifest.to_str().unwrap(), out.to_str().unwrap());
        let output = phasmid(&["--manifest", manifest, "--out", out_text, "--json"]);
        assert!(output.status.success(), "{name}: {output:?}");
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(json["axes"][0]["valid"], SIZE.0 * SIZE.1, "{name} {json}");
        let (header, x) = read_npy(&out.join("projector_x.npy"));
        assert!(header.contains("'shape': (20, 64)"), "{header}");
        for (i, x) in x.iter().enumerate() {
            let truth = column(i as u32 % SIZE.0, i as u32 / SIZE.0);
            assert!(
                (f64::from(*x) - truth).abs() < 0.5,
                "{name} {i}: {x} {truth}"
            );
        }
        for file in ["modulation.npy", "sigma_x.npy", "mask.png", "phase_x.png"] {
            assert!(out.join(file).exists(), "{file}");
        }
        assert!(!out.join("projector_y.npy").exists() && !out.join("cloud.ply").exists());
        // A second run into the same folder requires a flag.
        refused(
            &["--manifest", manifest, "--out", out_text],
            &["--force", "npy"],
        );
        let output = phasmid(&["--manifest", manifest, "--out", out_text, "--force"]);
        let table = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            output.status.success() && table.contains("axis x"),
            "{table}"
        );
    }
}

#[test]
fn pictures_in_wrong_order_are_warned_of_or_refused() {
    let root = tempfile::tempdir().unwrap();
    let (frames, out) = (root.path().join("frames"), root.path().join("out"));
    std::fs::create_dir(&frames).unwrap();
    write_sequence(&frames, "png", &save_grey8);
    let manifest = frames.join("sequence.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    // Remove the entry of the missing image, since an incomplete sequence cannot be checked.
    let (whole, _) = text.split_once("[[frame]]\nfile = \"gone.png\"").unwrap();
    std::fs::write(&manifest, whole).unwrap();
    let [manifest, out] = [&manifest, &out].map(|path| path.to_str().unwrap());
    let args = ["--manifest", manifest, "--out", out];
    assert!(phasmid(&args).status.success());
    let [two, five, kept] = ["2.png", "5.png", "kept.png"].map(|name| frames.join(name));
    for (from, to) in [(&two, &kept), (&five, &two), (&kept, &five)] {
        std::fs::rename(from, to).unwrap();
    }
    let again = [&args[..], &["--force"]].concat();
    let needles = ["sequence.toml", "look exchanged"];
    refused(&[&again[..], &["--strict"]].concat(), &needles);
    let output = phasmid(&[&again[..], &["--json"]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(
        json["doubt"].as_str().unwrap().contains(needles[1]),
        "{json}"
    );
    assert!(needles.iter().all(|needle| said.contains(needle)), "{said}");
}

#[test]
fn with_a_calibration_there_are_points() {
    let root = tempfile::tempdir().unwrap();
    write_sequence(root.path(), "png", &save_grey8);
    let view = |width: u32, height: u32, focal: f64, center: f64, x: f64| {
        format!(
            "lens = {{ width_px = {width}, height_px = {height}, focal_px = [{focal}, {focal}], \
             principal_px = [{center:?}, {:?}] }}\nrig_from_view = {{ rotation = [[1, 0, 0], [0, 1, 0], \
             [0, 0, 1]], translation_mm = [{x}, 0, 0] }}\n",
            f64::from(height) / 2.0
        )
        .replace("1, 0, 0]", "1.0, 0.0, 0.0]")
        .replace("[0, 1, 0]", "[0.0, 1.0, 0.0]")
        .replace("[0, 0, 1]", "[0.0, 0.0, 1.0]")
    };
    let rig = format!(
        "[camera]\n{}[projector]\n{}",
        view(SIZE.0, SIZE.1, 80.0, 32.0, 0.0),
        view(480, 300, 600.0, 600.0, 300.0)
    );
    let calibration = root.path().join("rig.toml");
    std::fs::write(&calibration, &rig).unwrap();
    let (manifest, out) = (root.path().join("sequence.toml"), root.path().join("out"));
    let args = |calibration: &Path| {
        [
            "--manifest",
            manifest.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
            "--calibration",
            calibration.to_str().unwrap(),
        ]
        .map(str::to_owned)
    };
    let run = |calibration: &Path| {
        let args = args(calibration);
        phasmid(&args.each_ref().map(String::as_str))
    };
    let output = run(&calibration);
    assert!(output.status.success(), "{output:?}");
    let (_, depth) = read_npy(&out.join("depth.npy"));
    let points = depth.iter().filter(|z| !z.is_nan()).count();
    assert_eq!(points, 64 * 20);
    // Closed form: intersection of the ray through pixel i with the plane of the pixel's projector
    // column.
    for (i, z) in depth.iter().enumerate().filter(|(_, z)| !z.is_nan()) {
        let (u, v) = (i as u32 % SIZE.0, i as u32 / SIZE.0);
        let camera = (f64::from(u) - 32.0) / 80.0;
        let truth = -300.0 / ((column(u, v) - 600.0) / 600.0 - camera);
        assert!(
            (f64::from(*z) / truth - 1.0).abs() < 0.01,
            "{u} {v}: {z} {truth}"
        );
    }
    let ply = std::fs::read(out.join("cloud.ply")).unwrap();
    let text = String::from_utf8_lossy(&ply[..300]).into_owned();
    assert!(text.starts_with("ply") && text.contains(&format!("element vertex {points}")));
    assert!(
        text.contains("property float nx") && text.contains("intensity"),
        "{text}"
    );
    // The same calibration in OpenCV's format. It states no sizes, so they are taken from the
    // photographs and the manifest.
    let opencv = root.path().join("rig.yml");
    let matrix = |name: &str, rows: u32, data: &str| {
        let cols = data.split(',').count() as u32 / rows;
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {data} ]\n"
        )
    };
    let text = [
        "%YAML:1.0\n---\n".to_owned(),
        matrix("Kc", 3, "80., 0., 32., 0., 80., 10., 0., 0., 1."),
        matrix("Kp", 3, "600., 0., 600., 0., 600., 150., 0., 0., 1."),
        matrix("Rp", 3, "1., 0., 0., 0., 1., 0., 0., 0., 1."),
        matrix("Tp", 3, "-300., 0., 0."),
    ];
    std::fs::write(&opencv, text.concat()).unwrap();
    std::fs::remove_dir_all(&out).unwrap();
    let output = run(&opencv);
    assert!(output.status.success(), "{output:?}");
    assert_eq!(read_npy(&out.join("depth.npy")).1, depth);
    // The formula of Wu et al., which is exact if the image planes are parallel to the plane, and
    // its options.
    let with = |more: &[&str]| {
        let args = args(&calibration);
        let args = [&args.each_ref().map(String::as_str)[..], &["--force"], more].concat();
        (
            phasmid(&args),
            args.into_iter().map(str::to_owned).collect::<Vec<_>>(),
        )
    };
    for plane in ["700", "1500"] {
        let (output, _) = with(&["--method", "height", "--plane-mm", plane]);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            said.contains(&format!("L = {plane}.000 mm, D = 300.000 mm")),
            "{output:?}"
        );
        let (_, other) = read_npy(&out.join("depth.npy"));
        let both = depth
            .iter()
            .zip(&other)
            .filter(|(a, b)| !a.is_nan() && !b.is_nan());
        assert!(both.clone().count() > 1000);
        let off = both.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f32::max);
        assert!(off < 2e-5, "{off}");
    }
    for (more, needle) in [
        (&["--plane-mm", "700"][..], "--method height"),
        (&["--method", "height", "--plane-mm", "0"], "--plane-mm"),
        (
            &["--method", "height", "--reference", "/nowhere"],
            "/nowhere",
        ),
        (
            &["--method", "height", "--height-d-mm", "nan"],
            "--height-d-mm",
        ),
    ] {
        let (_, args) = with(&[]);
        let args: Vec<&str> = args
            .iter()
            .map(String::as_str)
            .chain(more.iter().copied())
            .collect();
        refused(&args, &[needle]);
    }
    // The calibration of another camera is refused.
    let other = root.path().join("other.toml");
    std::fs::write(&other, rig.replace("width_px = 64", "width_px = 65")).unwrap();
    std::fs::remove_dir_all(&out).unwrap();
    let args = args(&other);
    refused(
        &args.each_ref().map(String::as_str),
        &["other.toml: camera.lens", "65 x 20", "64 x 20"],
    );
    assert!(!out.exists());
}

#[test]
fn refuses_bad_input_by_name_and_writes_nothing() {
    let root = tempfile::tempdir().unwrap();
    let folder = |name: &str| {
        let folder = root.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        write_sequence(&folder, "png", &save_grey8);
        folder
    };
    let check = |folder: &Path, more: &[&str], needles: &[&str]| {
        let out = folder.join("out");
        let (manifest, out_text) = (folder.join("sequence.toml"), out.to_str().unwrap());
        let args = [
            &["--manifest", manifest.to_str().unwrap(), "--out", out_text],
            more,
        ]
        .concat();
        refused(&args, needles);
        assert!(!out.exists());
    };
    let missing = folder("missing");
    std::fs::remove_file(missing.join("3.png")).unwrap();
    check(&missing, &[], &["3.png"]);
    check(
        &missing,
        &["--frames", "/nowhere/at/all"],
        &["/nowhere/at/all"],
    );

    let size = folder("size");
    GrayImage::new(63, 20).save(size.join("4.png")).unwrap();
    check(&size, &[], &["4.png", "63 x 20", "64 x 20"]);

    let depth = folder("depth");
    ImageBuffer::<Luma<u16>, _>::new(64, 20)
        .save(depth.join("5.png"))
        .unwrap();
    check(&depth, &[], &["5.png", "16"]);

    let broken = folder("broken");
    std::fs::write(broken.join("6.png"), b"\x89PNG\r\n\x1a\nnot really").unwrap();
    check(&broken, &[], &["6.png", "PNG, BMP or TIFF"]);
    let whole = std::fs::read(folder("whole").join("6.png")).unwrap();
    std::fs::write(broken.join("6.png"), &whole[..whole.len() / 2]).unwrap();
    check(&broken, &[], &["6.png"]);

    let two = folder("two");
    let text = std::fs::read_to_string(two.join("sequence.toml")).unwrap();
    let cut = text.match_indices("[[frame]]").nth(2).unwrap().0;
    std::fs::write(two.join("sequence.toml"), &text[..cut]).unwrap();
    check(&two, &[], &["sequence.toml", "2 steps", "period 500 px"]);

    let nameless = folder("nameless");
    std::fs::write(
        nameless.join("sequence.toml"),
        text.replace("file = \"2.png\"\n", ""),
    )
    .unwrap();
    check(&nameless, &[], &["frame[2].file"]);
    check(
        &nameless,
        &["--min-modulation", "nan"],
        &["--min-modulation"],
    );
    check(
        &nameless,
        &["--calibration", "/nowhere/rig.toml"],
        &["/nowhere/rig.toml"],
    );
}
