//! Point clouds as binary little-endian PLY.

use super::Cloud;
use crate::error::{Error, Result};
use std::path::Path;

/// Writes a cloud: x y z, then nx ny nz and intensity where the cloud has them, all float32.
///
/// # Errors
/// What the system refuses.
pub fn write_cloud(path: &Path, cloud: &Cloud) -> Result<()> {
    let mut names = vec!["x", "y", "z"];
    if cloud.normals.is_some() {
        names.extend(["nx", "ny", "nz"]);
    }
    if cloud.intensity.is_some() {
        names.push("intensity");
    }
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
        cloud.points.len()
    );
    for name in names {
        bytes += &format!("property float {name}\n");
    }
    bytes += "end_header\n";
    let mut bytes = bytes.into_bytes();
    for (i, point) in cloud.points.iter().enumerate() {
        let normal = cloud.normals.iter().flat_map(|n| n[i]);
        let intensity = cloud.intensity.iter().map(|v| v[i]);
        for value in point.iter().copied().chain(normal).chain(intensity) {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
    }
    std::fs::write(path, bytes).map_err(|e| Error::io(path, e))
}
