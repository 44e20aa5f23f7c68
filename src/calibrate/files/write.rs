//! Writes a rig as OpenCV's `FileStorage`, in YAML or XML, under Phasmid's node names and again
//! under SLStudio's.

use super::number::written;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_geometry::{Lens, Rig};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// OpenCV's two text formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `%YAML:1.0`, which every OpenCV since 1.0 reads.
    Yaml,
    /// `<opencv_storage>`.
    Xml,
}

/// RMS reprojection errors in pixels, as OpenCV's calibration functions return them. Unknown values
/// are not written.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reprojection {
    /// Error of the camera.
    pub camera_px: Option<f64>,
    /// Error of the projector.
    pub projector_px: Option<f64>,
    /// RMS error over the camera's and the projector's residuals.
    pub both_px: Option<f64>,
}

/// Writes a rig for `cv::FileStorage`: as XML if the name ends in `.xml`, as YAML if it ends in
/// `.yml` or `.yaml`.
///
/// # Errors
/// Returns an error if the name has another extension or the file system fails.
pub fn write_opencv(path: &Path, rig: &Rig, errors: &Reprojection) -> Result<()> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let format = match extension.to_ascii_lowercase().as_str() {
        "xml" => Format::Xml,
        "yml" | "yaml" => Format::Yaml,
        _ => {
            return Err(Error::input(
                path.display(),
                "a name that ends in neither a YAML nor an XML extension",
                "a name that ends in .yml, .yaml or .xml",
            ));
        }
    };
    let text = to_opencv(rig, errors, format);
    new_file::replace(path, |out| out.write_all(text.as_bytes()))
}

/// Formats a rig as the text of an OpenCV file. R and T transform points from the camera's frame to
/// the projector's, in millimetres; the format does not contain the rig's frame. Numbers have
/// enough digits to read back the same f64.
pub fn to_opencv(rig: &Rig, errors: &Reprojection, format: Format) -> String {
    let mut out = match format {
        Format::Yaml => "%YAML:1.0\n---\n".to_owned(),
        Format::Xml => "<?xml version=\"1.0\"?>\n<opencv_storage>\n".to_owned(),
    };
    for (name, value) in nodes(rig, errors) {
        // Writing to a string cannot fail.
        let _ = match format {
            Format::Yaml => yaml(&mut out, name, &value),
            Format::Xml => xml(&mut out, name, &value),
        };
    }
    if format == Format::Xml {
        out += "</opencv_storage>\n";
    }
    out
}

enum Item {
    Count(u32),
    Real(f64),
    Matrix(usize, usize, Vec<f64>),
}

fn nodes(rig: &Rig, errors: &Reprojection) -> Vec<(&'static str, Item)> {
    let projector_from_camera = rig.projector.rig_from_view.inverse() * rig.camera.rig_from_view;
    let matrix = |lens: &Lens| {
        let (f, c) = (lens.focal_px, lens.principal_px);
        Item::Matrix(3, 3, vec![f.x, 0.0, c.x, 0.0, f.y, c.y, 0.0, 0.0, 1.0])
    };
    let column = |list: &[f64]| Item::Matrix(list.len(), 1, list.to_vec());
    let rotation = || {
        let rows = projector_from_camera.rotation.transpose().to_cols_array();
        Item::Matrix(3, 3, rows.to_vec())
    };
    let translation = || column(&projector_from_camera.translation_mm.to_array());
    let (camera, projector) = (&rig.camera.lens, &rig.projector.lens);
    let mut nodes = vec![
        ("image_width", Item::Count(camera.width_px)),
        ("image_height", Item::Count(camera.height_px)),
        ("camera_matrix", matrix(camera)),
        ("distortion_coefficients", column(&camera.distortion)),
        ("projector_width", Item::Count(projector.width_px)),
        ("projector_height", Item::Count(projector.height_px)),
        ("projector_matrix", matrix(projector)),
        (
            "projector_distortion_coefficients",
            column(&projector.distortion),
        ),
        ("R", rotation()),
        ("T", translation()),
    ];
    let all = [errors.camera_px, errors.projector_px, errors.both_px];
    let ours = [
        "camera_reprojection_error",
        "projector_reprojection_error",
        "stereo_reprojection_error",
    ];
    let theirs = ["cam_error", "proj_error", "stereo_error"];
    let known = |names: [&'static str; 3]| {
        let pairs = names.into_iter().zip(all);
        pairs.filter_map(|(name, error)| {
            let error = error.filter(|error| error.is_finite())?;
            Some((name, Item::Real(error)))
        })
    };
    nodes.extend(known(ours));
    nodes.extend([
        ("Kc", matrix(camera)),
        ("kc", column(&camera.distortion)),
        ("Kp", matrix(projector)),
        ("kp", column(&projector.distortion)),
        ("Rp", rotation()),
        ("Tp", translation()),
    ]);
    nodes.extend(known(theirs));
    nodes.extend([
        ("frameWidth", Item::Count(camera.width_px)),
        ("frameHeight", Item::Count(camera.height_px)),
        ("screenResX", Item::Count(projector.width_px)),
        ("screenResY", Item::Count(projector.height_px)),
    ]);
    nodes
}

/// Formats the rows of a matrix, each on its own line.
fn rows(cols: usize, data: &[f64], between: &str, line: &str) -> String {
    let rows = data.chunks(cols.max(1)).map(|row| {
        let row: Vec<String> = row.iter().map(|x| written(*x)).collect();
        row.join(between)
    });
    rows.collect::<Vec<_>>().join(line)
}

fn yaml(out: &mut String, name: &str, item: &Item) -> std::fmt::Result {
    match item {
        Item::Count(n) => writeln!(out, "{name}: {n}"),
        Item::Real(x) => writeln!(out, "{name}: {}", written(*x)),
        Item::Matrix(r, c, data) => writeln!(
            out,
            "{name}: !!opencv-matrix\n   rows: {r}\n   cols: {c}\n   dt: d\n   data: [ {} ]",
            rows(*c, data, ", ", ",\n       ")
        ),
    }
}

fn xml(out: &mut String, name: &str, item: &Item) -> std::fmt::Result {
    match item {
        Item::Count(n) => writeln!(out, "<{name}>{n}</{name}>"),
        Item::Real(x) => writeln!(out, "<{name}>{}</{name}>", written(*x)),
        Item::Matrix(r, c, data) => writeln!(
            out,
            "<{name} type_id=\"opencv-matrix\">\n  <rows>{r}</rows>\n  <cols>{c}</cols>\n  \
             <dt>d</dt>\n  <data>\n    {}</data></{name}>",
            rows(*c, data, " ", "\n    ")
        ),
    }
}
