//! Assembles a rig from named matrices.

use super::node::{Fault, Node, Nodes, Value, names};
use glam::{DMat3, DVec2, DVec3};
use phasmid_geometry::{Lens, Pose, Rig, View};

/// Maximum difference between an element of R R' and the identity matrix. It is not zero, because files
/// may be written with few digits.
const WORST_ROTATION: f64 = 1e-4;

/// Image sizes (columns, rows), for files that do not contain them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Size of the camera's image.
    pub camera: Option<[u32; 2]>,
    /// Size of the projector's image.
    pub projector: Option<[u32; 2]>,
}

/// Assembles a rig, in the camera's frame.
///
/// # Errors
/// Returns an error if a matrix or an image size is missing, or if a matrix is invalid.
pub(super) fn rig(nodes: &Nodes, sizes: Sizes) -> Result<Rig, Fault> {
    let camera = View {
        lens: lens(
            nodes,
            "camera",
            names::CAMERA,
            names::CAMERA_LENS,
            [names::CAMERA_WIDTH, names::CAMERA_HEIGHT],
            sizes.camera,
        )?,
        rig_from_view: Pose::IDENTITY,
    };
    let projector_lens = lens(
        nodes,
        "projector",
        names::PROJECTOR,
        names::PROJECTOR_LENS,
        [names::PROJECTOR_WIDTH, names::PROJECTOR_HEIGHT],
        sizes.projector,
    )?;
    let projector_from_camera = Pose {
        rotation: rotation(need(nodes, names::ROTATION)?)?,
        translation_mm: {
            let node = need(nodes, names::TRANSLATION)?;
            let [x, y, z] = *fixed::<3>(node, "3 numbers")?;
            DVec3::new(x, y, z)
        },
    };
    Ok(Rig {
        camera,
        projector: View {
            lens: projector_lens,
            rig_from_view: projector_from_camera.inverse(),
        },
        noise: None,
        covariance: None,
    })
}

/// Builds a lens from its camera matrix, its coefficients (no distortion if absent) and its image
/// size.
fn lens(
    nodes: &Nodes,
    who: &str,
    matrix: &[&str],
    distortion: &[&str],
    size: [&[&str]; 2],
    given: Option<[u32; 2]>,
) -> Result<Lens, Fault> {
    let node = need(nodes, matrix)?;
    let k = *square(node)?;
    let [fx, skew, cx, zero, fy, cy, a, b, one_] = k;
    let straight = skew.abs() <= 1e-9 * fx.abs() && [zero, a, b, one_] == [0.0, 0.0, 0.0, 1.0];
    if !straight {
        return Err(Fault::new(
            node.line,
            format!("{}: {k:?}", node.name),
            "fx 0 cx, 0 fy cy, 0 0 1: a camera matrix without skew",
        ));
    }
    let distortion = match nodes.get(distortion)? {
        Some(node) => coefficients(node)?,
        None => [0.0; 5],
    };
    let [width, height] = size.map(|names| pixels(nodes, names));
    let [width_px, height_px] = match (width?, height?, given) {
        (Some(width), Some(height), _) => [width, height],
        (_, _, Some(size)) => size,
        _ => {
            return Err(Fault::new(
                0,
                format!("no image size of the {who}"),
                format!(
                    "{} and {}, or {} and {}; decode takes them from the images and the manifest",
                    size[0][0], size[1][0], size[0][1], size[1][1]
                ),
            ));
        }
    };
    Ok(Lens {
        width_px,
        height_px,
        focal_px: DVec2::new(fx, fy),
        principal_px: DVec2::new(cx, cy),
        distortion,
    })
}

/// Reads OpenCV's k1 k2 p1 p2 (k3 (k4 k5 k6 (s1 s2 s3 s4 (tx ty)))). `Lens` has the first five
/// coefficients; the others must be zero.
fn coefficients(node: &Node) -> Result<[f64; 5], Fault> {
    let list = node.value.numbers();
    let wrong = |found: String| {
        let allowed = "k1 k2 p1 p2 or k1 k2 p1 p2 k3, and zeros after them";
        Err(Fault::new(
            node.line,
            format!("{}: {found}", node.name),
            allowed,
        ))
    };
    if ![0, 4, 5, 8, 12, 14].contains(&list.len()) {
        return wrong(format!("{} numbers", list.len()));
    }
    if list.iter().skip(5).any(|&k| k != 0.0) {
        return wrong(format!("a model of {} coefficients", list.len()));
    }
    let mut five = [0.0; 5];
    five.iter_mut().zip(list).for_each(|(to, from)| *to = *from);
    Ok(five)
}

/// Reads a rotation, which may be written with few digits, and returns the nearest exact one.
fn rotation(node: &Node) -> Result<DMat3, Fault> {
    let found = DMat3::from_cols_slice(square(node)?).transpose();
    let away = |r: DMat3| {
        let off = r * r.transpose() - DMat3::IDENTITY;
        let off = off.to_cols_array();
        off.iter().fold(0.0, |worst: f64, x| worst.max(x.abs()))
    };
    // The comparison is negated so that NaN is refused.
    let wrong = match away(found) {
        off if !(off <= WORST_ROTATION) => Some(format!("a matrix {off:.1e} away from a rotation")),
        _ if found.determinant() < 0.0 => Some("a reflection, determinant -1".to_owned()),
        _ => None,
    };
    if let Some(wrong) = wrong {
        return Err(Fault::new(
            node.line,
            format!("{}: {wrong}", node.name),
            format!("orthonormal rows to {WORST_ROTATION:e}, determinant +1"),
        ));
    }
    // Newton's iteration to the orthogonal factor (Higham, SIAM J. Sci. Stat. Comput. 7 (1986),
    // equation 3.5). A matrix that is orthonormal to rounding is kept bit for bit.
    let mut nearest = found;
    for _ in 0..4 {
        if away(nearest) < 1e-14 {
            break;
        }
        nearest = (nearest + nearest.inverse().transpose()) * 0.5;
    }
    Ok(nearest)
}

fn need<'a>(nodes: &'a Nodes, names: &[&str]) -> Result<&'a Node, Fault> {
    nodes
        .get(names)?
        .ok_or_else(|| Fault::new(0, format!("no {}", names[0]), names.join(", or ")))
}

/// The nine numbers of a 3 x 3 matrix.
fn square(node: &Node) -> Result<&[f64; 9], Fault> {
    match node.value {
        Value::Matrix { rows, cols, .. } if (rows, cols) != (3, 3) => Err(Fault::new(
            node.line,
            format!("{}: {rows} x {cols}", node.name),
            "3 x 3",
        )),
        _ => fixed(node, "3 x 3 numbers"),
    }
}

fn fixed<'a, const N: usize>(node: &'a Node, wanted: &str) -> Result<&'a [f64; N], Fault> {
    let list = node.value.numbers();
    let found = |found: String| Fault::new(node.line, format!("{}: {found}", node.name), wanted);
    let numbers = list
        .try_into()
        .map_err(|_| found(format!("{} numbers", list.len())))?;
    match list.iter().find(|x| !x.is_finite()) {
        Some(x) => Err(found(x.to_string())),
        None => Ok(numbers),
    }
}

/// Reads an image dimension. SLStudio writes 0 for an unknown size, so 0 counts as missing.
fn pixels(nodes: &Nodes, names: &[&str]) -> Result<Option<u32>, Fault> {
    let Some(node) = nodes.get(names)? else {
        return Ok(None);
    };
    match *node.value.numbers() {
        [0.0] => Ok(None),
        [n] if n.fract() == 0.0 && (1.0..=32768.0).contains(&n) => Ok(Some(n as u32)),
        ref list => {
            let found = match list {
                [n] => format!("{n:?}").trim_end_matches(".0").to_owned(),
                _ => format!("{} numbers", list.len()),
            };
            let found = format!("{}: {found}", node.name);
            Err(Fault::new(node.line, found, "1 to 32768 pixels"))
        }
    }
}
