//! Tests with round trips, files of other programs, and malformed files.

use super::*;
use glam::{DVec2, DVec3};
use phasmid_geometry::{Lens, Pose, View};
use proptest::prelude::*;

fn rig() -> Rig {
    let lens = |width_px, height_px, f, principal_px, distortion| Lens {
        width_px,
        height_px,
        focal_px: DVec2::new(f, f + 1.0 / 3.0),
        principal_px,
        distortion,
    };
    let pose = Pose::from_xyz_deg(DVec3::new(400.1, 20.0, -15.0), DVec3::new(1.0, -3.0, 2.0));
    Rig {
        camera: View {
            lens: lens(
                1138,
                489,
                632.2,
                DVec2::new(568.4, 244.1),
                [-0.02, 0.01, 1e-4, -2e-5, 1e-7],
            ),
            rig_from_view: Pose::IDENTITY,
        },
        projector: View {
            lens: lens(1920, 1080, 2751.0, DVec2::new(2060.0, 539.5), [0.0; 5]),
            rig_from_view: pose,
        },
        noise: None,
        covariance: None,
    }
}

fn read(text: &str) -> Result<Rig> {
    rig_from_bytes(text.as_bytes(), "c", Sizes::default())
}

fn message(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

/// SLStudio's output: f32 matrices, five distortion coefficients as rows, sizes at the end.
const SLSTUDIO_XML: &str = r#"<?xml version="1.0"?>
<opencv_storage>
<Kc type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>f</dt>
  <data>
    8.5e+02 0. 3.25e+02 0. 8.625e+02 2.5e+02 0.
    0. 1.</data></Kc>
<kc type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>f</dt>
  <data>
    -2.5e-01 1.25e-01 0. 0. 0.</data></kc>
<Kp type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>f</dt>
  <data>
    2.5e+03 0. 8.5e+02 0. 2.5e+03 1.125e+03 0. 0. 1.</data></Kp>
<kp type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>f</dt>
  <data>
    -3.125e-02 -5.0e-02 0. 0. 0.</data></kp>
<Rp type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>f</dt>
  <data>
    8.66025388e-01 0. 5.00000000e-01 0. 1. 0. -5.00000000e-01 0.
    8.66025388e-01</data></Rp>
<Tp type_id="opencv-matrix"><rows>3</rows><cols>1</cols><dt>f</dt>
  <data>
    -1.75e+02 -4.5 1.0e-02</data></Tp>
<cam_error>1.1528474710036161e-01</cam_error>
<frameWidth>640</frameWidth>
<frameHeight>512</frameHeight>
<screenResX>912</screenResX>
<screenResY>1140</screenResY>
</opencv_storage>
"#;

#[test]
fn every_format_brings_the_numbers_back() {
    let rig = rig();
    let errors = Reprojection {
        camera_px: Some(0.011),
        projector_px: Some(f64::NAN),
        both_px: None,
    };
    for format in [Format::Yaml, Format::Xml] {
        let text = to_opencv(&rig, &errors, format);
        assert!(
            text.contains("cam_error") && !text.contains("proj_error"),
            "{text}"
        );
        let back = read(&text).unwrap();
        assert_eq!(back.camera, rig.camera);
        assert_eq!(back.projector.lens, rig.projector.lens);
        let (a, b) = (back.projector.rig_from_view, rig.projector.rig_from_view);
        assert_eq!(a.rotation, b.rotation);
        // The file contains the inverse of the rig's pose, so rounding occurs twice.
        assert!((a.translation_mm - b.translation_mm).length() < 1e-12);
    }
    assert_eq!(read(&rig.to_toml()).unwrap(), rig);
}

#[test]
fn r_and_t_take_the_camera_s_points_to_the_projector() {
    let text = to_opencv(&rig(), &Reprojection::default(), Format::Yaml);
    // This assertion fails if R and T are written in the opposite direction.
    let direct = rig().projector.rig_from_view.inverse();
    let back = read(&text).unwrap();
    let p = DVec3::new(10.0, -20.0, 900.0);
    let local = direct.point(p);
    let px = rig().projector.lens.project(local).unwrap();
    assert!((back.projector.project(p).unwrap() - px).length() < 1e-9);
}

#[test]
fn slstudio_s_xml_is_read_with_its_directions() {
    let rig = read(SLSTUDIO_XML).unwrap();
    assert_eq!(rig.camera.lens.focal_px, DVec2::new(850.0, 862.5));
    assert_eq!(rig.camera.lens.distortion, [-0.25, 0.125, 0.0, 0.0, 0.0]);
    assert_eq!(
        (rig.camera.lens.width_px, rig.camera.lens.height_px),
        (640, 512)
    );
    assert_eq!(
        (rig.projector.lens.width_px, rig.projector.lens.height_px),
        (912, 1140)
    );
    // The projector's centre is -Rp^T Tp: to the right of the camera, looking left.
    let (s, c) = (0.5, 0.75f64.sqrt());
    let center = DVec3::new(175.0 * c + 0.01 * s, 4.5, 175.0 * s - 0.01 * c);
    let found = rig.projector.center();
    assert!((found - center).length() < 1e-4, "{found} {center}");
    // f32 rotations are made orthonormal.
    let r = rig.projector.rig_from_view.rotation;
    let off = (r * r.transpose() - glam::DMat3::IDENTITY).to_cols_array();
    assert!(off.iter().all(|x| x.abs() < 1e-14), "{off:?}");
}

/// The same calibration in SLStudio's two other formats, without sizes and with few digits.
const SLCALIB: &str = "#V1.0 SLStudio calibration\n#Calibration time: now\n\n\
    Kc\n850.000000 0.000000 325.000000\n0.000000 862.500000 250.000000\n0.000000 0.000000 1.000000\n\n\
    kc\n-0.250000 0.125000 0.000000 0.000000 0.000000\n\n\
    Kp\n2500.0 0.0 850.0\n0.0 2500.0 1125.0\n0.0 0.0 1.0\n\n\
    kp\n-0.031250 -0.050000 0.000000 0.000000 0.000000\n\n\
    Rp\n0.866025 0.000000 0.500000\n0.000000 1.000000 0.000000\n-0.500000 0.000000 0.866025\n\n\
    Tp\n-175.000000 -4.500000 0.010000\n\n\
    cam_error: 0.115285\n\nproj_error: 0.4\n\nstereo_error: 0.35\n\n";
/// The same calibration in OpenCV 5's JSON.
const JSON: &str = r#"{
    "Kc": {
        "type_id": "opencv-matrix",
        "rows": 3,
        "cols": 3,
        "dt": "f",
        "data": [ 850.0, 0.0, 325.0, 0.0, 862.5, 250.0, 0.0, 0.0,
            1. ]
    },
    "kc": [ -2.5e-01, 0.125, 0.0, 0.0, 0.0 ],
    "text": "a \"R\": {",
    "nested": { "R": [ 7, { "Tp": [ ] } ], "none": { } },
    "points": { "type_id": "opencv-matrix", "rows": .Nan },
    "Kp": { "rows": 3, "cols": 3, "dt": "d",
        "data": [ 2500, 0, 850, 0, 2500, 1125, 0, 0, 1 ] },
    "kp": { "type_id": "opencv-matrix", "rows": 1, "cols": 5, "dt": "f",
        "data": [ -0.03125, -5.0e-02, 0.0, 0.0, 0.0 ] },
    "Rp": { "type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "f",
        "data": [ 0.866025388, 0.0, 0.5, 0.0, 1.0, 0.0, -0.5, 0.0, 0.866025388 ] },
    "Tp": { "type_id": "opencv-matrix", "rows": 3, "cols": 1, "dt": "f",
        "data": [ -175.0, -4.5, 0.01 ] },
    "frameWidth": 640, "frameHeight": 512,
    "screenResX": 912, "screenResY": 1140
}
"#;
const MATLAB: &str = "%%SLStudio calibration\nKc = [850, 0, 325;\n 0, 862.5, 250;\n 0, 0, 1];\n\
    kc = [-0.25; 0.125; 0; 0; 0];\nKp = [2500, 0, 850;\n 0, 2500, 1125;\n 0, 0, 1];\n\
    kp = [-0.03125, -0.05, 0, 0, 0];\nRp = [0.86602539, 0, 0.5;\n 0, 1, 0;\n -0.5, 0, 0.86602539];\n\
    Tp = [-175; -4.5; 0.01];\n";

#[test]
fn slstudio_s_texts_want_the_sizes_from_elsewhere() {
    let wanted = read(SLSTUDIO_XML).unwrap();
    let sizes = Sizes {
        camera: Some([640, 512]),
        projector: Some([912, 1140]),
    };
    let bare = MATLAB.lines().skip(1).collect::<Vec<_>>().join("\n");
    assert!(bare.starts_with("Kc = [850"));
    for text in [SLCALIB, MATLAB, &bare] {
        let rig = rig_from_bytes(text.as_bytes(), "c", sizes).unwrap();
        assert_eq!(rig.camera, wanted.camera);
        assert_eq!(rig.projector.lens, wanted.projector.lens);
        let off = rig.projector.center() - wanted.projector.center();
        assert!(off.length() < 2e-4, "{off}");
        let error = message(text);
        assert!(error.contains("no image size of the camera"), "{error}");
        assert!(
            error.contains("image_width and image_height, or frameWidth and"),
            "{error}"
        );
        let with = format!(
            "{text}\nframeWidth: 640\nframeHeight: 512\nscreenResX 912\nscreenResY = 1140\n"
        );
        assert_eq!(read(&with).unwrap(), rig);
    }
    // SLStudio writes 0 for unknown sizes.
    let unknown = SLSTUDIO_XML.replace(">912<", ">0<");
    assert!(message(&unknown).contains("no image size of the projector"));
    assert_eq!(
        rig_from_bytes(unknown.as_bytes(), "c", sizes).unwrap(),
        wanted
    );
}

#[test]
fn reads_json_and_errors_name_line_and_field() {
    assert_eq!(read(JSON).unwrap(), read(SLSTUDIO_XML).unwrap());
    let flat = JSON.replace('\n', " ");
    assert_eq!(read(&flat).unwrap(), read(JSON).unwrap());
    for (from, to, needle) in [
        ("862.5", "six", "c:7: Kc: `six`; expected a number"),
        (
            "\"rows\": 3",
            "\"rows\": 4",
            "Kc: 9 numbers; expected 4 x 3",
        ),
        ("\"dt\": \"f\"", "\"dt\": [ 1 ]", "c:6: Kc: dt: `[ 1 ]`"),
        ("0.125", "[ 1 ]", "c:10: kc: `[`"),
        ("\"text\": ", "\"text\" ", "c:11: "),
        ("0.0 ],\n    \"text", "0.0 ]\n    \"text", "c:11: `\"text"),
        (
            "\"text",
            "text",
            "c:11: `text`; expected a name in double quotes",
        ),
        (
            "\"text\": \"a",
            "\"text\": \"a\n",
            "c:11: a string that is not closed",
        ),
        ("{ \"R\": [", "{ \"R\": (", "c:12: `]`; expected `}`"),
        (
            "\"nested\": {",
            "\"nested\": { {",
            "c:1: a bracket that is not closed",
        ),
        ("\"kc\"", "\"Kc\"", "c:10: Kc again, after line 2"),
        (
            "1140\n}",
            "1140\n} }",
            "c:24: `}`; expected the end of the file",
        ),
        ("912", "", "c:23: `, \"screenResY\": 1140`"),
        (
            "\"frameWidth\": 640",
            "\"frameWidth\": [ ]",
            "frameWidth: 0 numbers",
        ),
    ] {
        let broken = JSON.replacen(from, to, 1);
        assert_ne!(broken, JSON, "{from}");
        let found = match read(&broken) {
            Ok(_) => "read".to_owned(),
            Err(error) => error.to_string(),
        };
        assert!(found.contains(needle), "{found}\nwanted {needle}");
    }
    assert!(message("{}").contains("no camera_matrix"));
    assert!(message("{").contains("c:1: a bracket that is not closed"));
}

#[test]
fn skips_unrelated_content_of_a_file() {
    let yaml = to_opencv(&rig(), &Reprojection::default(), Format::Yaml);
    let rest = "calibration_time: \"Sat: 21\"\nflags: 0\nimages:\n   - \"a: b.png\"\n- c\n\
        nested:\n   R: 7\n   deep: { a:1 }\npoints: !!opencv-matrix\n   rows: broken\n# R: 1\n\
        names: [ a, b,\n]\n";
    let with = yaml.replacen("---\n", &format!("---\n{rest}"), 1);
    assert_eq!(read(&with).unwrap().camera, rig().camera);
    // The first lines that OpenCV 5 and ROS write.
    let five = yaml.replace("%YAML:1.0", "%YAML 1.2").replace('\n', "\r\n");
    assert_eq!(read(&five).unwrap().camera, rig().camera);
    let ros = yaml
        .replace("%YAML:1.0\n---\n", "")
        .replace(" !!opencv-matrix", "");
    assert_eq!(read(&ros).unwrap().camera, rig().camera);
    let xml = to_opencv(&rig(), &Reprojection::default(), Format::Xml);
    let rest = "<!-- R > T --><text>\"a &lt; b\"</text><m><R>7</R><l>1 x <_ type_id=\"opencv-matrix\">\
        <rows>1</rows></_></l></m><none/><points type_id=\"opencv-matrix\"><rows>x</rows></points>";
    let with = xml.replacen("<opencv_storage>", &format!("<opencv_storage>{rest}"), 1);
    assert_eq!(read(&with).unwrap().camera, rig().camera);
}

#[test]
fn errors_name_line_and_field() {
    let yaml = to_opencv(&rig(), &Reprojection::default(), Format::Yaml);
    let xml = to_opencv(&rig(), &Reprojection::default(), Format::Xml);
    // Remove the nodes with SLStudio's names, which repeat the values of Phasmid's nodes.
    let ours = yaml.split("Kc:").next().unwrap().to_owned();
    for (text, from, to, needle) in [
        (
            &ours,
            "632.2",
            "six",
            "c:9: camera_matrix: `six`; expected a number",
        ),
        (&ours, "632.2", ".Nan", "c:5: camera_matrix: NaN"),
        (&ours, "rows: 3", "rows: 4", "9 numbers; expected 4 x 3"),
        (&ours, "rows: 3\n", "", "camera_matrix: no rows"),
        (&ours, "dt: d", "dt: z", "dt: `z`"),
        (&ours, " ]", "", "a list that is not closed"),
        (
            &ours,
            "image_width: 1138",
            "image_width",
            "c:3: `image_width`",
        ),
        (
            &ours,
            "image_width: 1138",
            "image_width: 1e9",
            "c:3: image_width: 1000000000; expected 1 to",
        ),
        (&ours, "\nT: ", "\nt: ", "no T; expected T, or Tp"),
        (
            &ours,
            "image_height",
            "image_width",
            "c:4: image_width again, after line 3",
        ),
        (
            &yaml,
            "frameWidth: 1138",
            "frameWidth: 1139",
            "frameWidth that differs from image_width of line 3",
        ),
        (&ours, "-0.02", "-9", "an image that folds over"),
        (
            &xml,
            "</camera_matrix>",
            "</camera>",
            "</`camera`>; expected </`camera_matrix`>",
        ),
        (&xml, "632.2", "six", "camera_matrix: `six`"),
        (
            &xml,
            "<opencv_storage>",
            "<!DOCTYPE a [<!ENTITY b \"c\">]><opencv_storage>",
            "document type",
        ),
        (
            &xml,
            "opencv_storage>",
            "storage>",
            "<`storage`>; expected one <opencv_storage>",
        ),
        (
            &xml,
            "</opencv_storage>",
            "",
            "the end of the file in <`opencv_storage`>",
        ),
    ] {
        let broken = text.replacen(from, to, 1);
        assert_ne!(&broken, text, "{from}");
        let found = message(&broken);
        assert!(found.contains(needle), "{found}\nwanted {needle}");
    }
    let no = |name: &str| {
        let lines: Vec<&str> = SLCALIB.split(name).collect();
        message(&format!(
            "{}\nframeWidth 640\nframeHeight 512\n",
            lines.join("Xx")
        ))
    };
    assert!(
        no("Kp").contains("no projector_matrix; expected projector_matrix, or Kp"),
        "{}",
        no("Kp")
    );
    for (text, needle) in [
        ("", "missing field"),
        ("PNG", "c:1"),
        ("<", "a tag that is not closed"),
        ("<a></a>", "one <opencv_storage>"),
        ("<opencv_storage/>", "no camera_matrix"),
        ("%YAML:1.0", "no camera_matrix"),
        ("<opencv_storage/>x", "`x`"),
        ("<opencv_storage/><opencv_storage/>", "one <opencv_storage>"),
    ] {
        let found = message(text);
        assert!(found.contains(needle), "{text}: {found}");
    }
    let bytes = rig_from_bytes(&[0x1f, 0x8b, 0xff], "c", Sizes::default());
    assert!(bytes.unwrap_err().to_string().contains("UTF-8"));
    // More coefficients than supported, a skew, a reflection, a projector at the camera's position.
    for (from, to, needle) in [
        (
            "kc\n-0.250000 0.125000 0.000000 0.000000 0.000000",
            "kc\n0 0 0 0 0 1 0 0",
            "8 coefficients",
        ),
        ("kc\n-0.250000 ", "kc\n", "kc: 4 numbers"),
        ("850.000000 0.000000", "850.000000 0.1", "without skew"),
        (
            "0.000000 1.000000 0.000000",
            "0 -1 0",
            "Rp: a reflection, determinant -1; expected orthonormal",
        ),
        (
            "0.000000 1.000000 0.000000",
            "0 1.1 0",
            "Rp: a matrix 2.1e-1 away from a rotation",
        ),
        ("-175.000000 -4.500000 0.010000", "0 0 0", "zero baseline"),
    ] {
        let text =
            format!("{SLCALIB}frameWidth 640\nframeHeight 512\nscreenResX 912\nscreenResY 1140\n");
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text, "{from}");
        match (read(&broken), needle) {
            (Ok(rig), "kc: 4 numbers") => assert_eq!(rig.camera.lens.distortion[0], 0.125),
            (Ok(_), _) => panic!("{needle}"),
            (Err(e), _) => assert!(e.to_string().contains(needle), "{e}"),
        }
    }
}

#[test]
fn a_file_of_any_nesting_and_size_is_read_in_no_time() {
    let deep = "<opencv_storage>".to_owned() + &"<a>".repeat(100_000);
    assert!(message(&deep).contains("levels"));
    let deep = "{\"a\":".repeat(100_000);
    assert!(message(&deep).contains("levels"));
    for (one, begin) in [
        ("a: 1\n", "%YAML:1.0\n"),
        (" -\n", "%YAML:1.0\na:\n"),
        ("<a b=\"c\"/>", "<opencv_storage>"),
        ("1<!---->", "<opencv_storage><Kc>"),
        ("[", "Kc: ["),
        ("[", "{\"Kc\": "),
        ("\"a\":[1],", "{"),
        ("Xx 1\n", "#V\n"),
    ] {
        let text = begin.to_owned() + &one.repeat((4 << 20) / one.len());
        assert!(read(&text).is_err());
    }
}

#[test]
fn format_is_recognised_by_content_not_by_extension() {
    let dir = tempfile::tempdir().unwrap();
    let rig = rig();
    for name in ["c.yml", "c.yaml", "c.xml"] {
        let path = dir.path().join(name);
        write_opencv(&path, &rig, &Reprojection::default()).unwrap();
        let other = dir.path().join("c.toml");
        std::fs::rename(&path, &other).unwrap();
        assert_eq!(read_rig(&other).unwrap().camera, rig.camera);
    }
    let error = write_opencv(&dir.path().join("c.json"), &rig, &Reprojection::default());
    assert!(error.unwrap_err().to_string().contains(".yml"));
    assert_eq!(read_rig(dir.path()).unwrap_err().exit_code(), 2);
    assert_eq!(
        read_rig(&dir.path().join("none")).unwrap_err().exit_code(),
        2
    );
}

proptest! {
    /// Reading terminates for any text, and yields an error or a valid rig.
    #[test]
    fn any_text_is_read_or_refused(
        format in 0usize..5,
        at in any::<prop::sample::Index>(),
        cut in 0usize..40,
        put in "[ -~\\n]{0,12}|[<>/!:\\[\\]#%.-]{0,6}|\\PC{0,4}",
    ) {
        let text = match format {
            0 => to_opencv(&rig(), &Reprojection::default(), Format::Yaml),
            1 => to_opencv(&rig(), &Reprojection::default(), Format::Xml),
            2 => SLCALIB.to_owned(),
            3 => JSON.to_owned(),
            _ => MATLAB.to_owned(),
        };
        let at = at.index(text.len());
        let end = (at + cut).min(text.len());
        let broken = format!("{}{put}{}", &text[..at], &text[end..]);
        if let Ok(rig) = read(&broken) {
            prop_assert!(rig.check().is_ok());
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = rig_from_bytes(&bytes, "c", Sizes::default());
    }
}
