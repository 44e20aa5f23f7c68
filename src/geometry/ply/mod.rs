//! PLY files: meshes and clouds, read in any encoding, written in binary little endian.

mod body;
mod header;
#[cfg(test)]
mod tests;

use super::{Cloud, Mesh, file};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use std::io::Write;
use std::path::Path;

/// Content of a PLY file.
#[derive(Debug, Clone, PartialEq)]
pub enum Ply {
    /// A file with faces.
    Mesh(Mesh),
    /// A file with vertices only.
    Cloud(Cloud),
}

/// Reads a PLY file: a mesh if it has a face of three corners or more, else a cloud.
///
/// # Errors
/// Returns an error if the file cannot be read, or is malformed, truncated or empty.
pub fn read(path: &Path) -> Result<Ply> {
    parse(&file::read(path)?, &path.display().to_string())
}

/// Reads the vertices of a PLY file as a cloud in millimetres, in file order, with `nx ny nz` and
/// `intensity` and `sigma` if present. Intensities of type uchar and ushort are divided by 255 and
/// 65535.
/// Points that are not finite are kept, because organised clouds mark missing pixels with them and
/// rows must keep their layout.
///
/// # Errors
/// Returns an error if the file cannot be read, is malformed or truncated, or has no finite point.
pub fn read_cloud(path: &Path) -> Result<Cloud> {
    let place = path.display().to_string();
    cloud(content(&file::read(path)?, &place)?, &place)
}

/// Writes a cloud: `x y z`, and `nx ny nz`, `intensity` and `sigma` if present, all float.
///
/// # Errors
/// Returns an error if the file cannot be written, or if the number of normals, intensities or
/// standard deviations differs from that of the points.
pub fn write_cloud(path: &Path, cloud: &Cloud) -> Result<()> {
    let encoded = encode_cloud(cloud).map_err(|e| e.at(path.display()))?;
    new_file::replace(path, |out| out.write_all(&encoded))
}

/// Returns the PLY file of a cloud, as [`write_cloud`] writes it.
///
/// # Errors
/// Returns an error if the number of normals, intensities or standard deviations differs from that of
/// the points.
pub fn encode_cloud(cloud: &Cloud) -> Result<Vec<u8>> {
    let count = cloud.points.len();
    let normals = cloud.normals.as_ref();
    let scalars = [("intensity", &cloud.intensity), ("sigma", &cloud.sigma_mm)];
    let scalars = scalars.map(|(name, values)| (name, values.as_ref()));
    let given = scalars.map(|(_, values)| values.map(Vec::len));
    let counts = [normals.map(Vec::len), given[0], given[1]];
    if counts.into_iter().flatten().any(|n| n != count) {
        return Err(Error::device(
            "the number of normals, intensities or standard deviations differs from that of the points",
        ));
    }
    let mut encoded = Vec::new();
    let out = &mut encoded;
    let written = (|| -> std::io::Result<()> {
        preamble(out, count)?;
        for name in ["x", "y", "z"] {
            writeln!(out, "property float {name}")?;
        }
        if normals.is_some() {
            for name in ["nx", "ny", "nz"] {
                writeln!(out, "property float {name}")?;
            }
        }
        for (name, _) in scalars.iter().filter(|(_, values)| values.is_some()) {
            writeln!(out, "property float {name}")?;
        }
        writeln!(out, "end_header")?;
        for (i, point) in cloud.points.iter().enumerate() {
            let normal = normals.map(|n| n[i]);
            let scalars = scalars
                .iter()
                .filter_map(|(_, values)| Some(&(*values)?[i]));
            for value in point.iter().chain(normal.iter().flatten()).chain(scalars) {
                out.write_all(&value.to_le_bytes())?;
            }
        }
        Ok(())
    })();
    // Writing to memory does not fail.
    written.map_err(|e| Error::io("cloud", e))?;
    Ok(encoded)
}

/// Writes a mesh: `x y z` as double, so that it reads back bit for bit, and its triangles.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_mesh(path: &Path, mesh: &Mesh) -> Result<()> {
    new_file::replace(path, |out| {
        preamble(out, mesh.vertices.len())?;
        for name in ["x", "y", "z"] {
            writeln!(out, "property double {name}")?;
        }
        writeln!(out, "element face {}", mesh.triangles.len())?;
        writeln!(out, "property list uchar uint vertex_indices")?;
        writeln!(out, "end_header")?;
        for vertex in &mesh.vertices {
            for value in vertex.to_array() {
                out.write_all(&value.to_le_bytes())?;
            }
        }
        for triangle in &mesh.triangles {
            out.write_all(&[3])?;
            for index in triangle {
                out.write_all(&index.to_le_bytes())?;
            }
        }
        Ok(())
    })
}

fn preamble(out: &mut impl Write, vertices: usize) -> std::io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    writeln!(out, "comment millimetres")?;
    writeln!(out, "element vertex {vertices}")
}

/// Parses a PLY file that must contain a mesh.
pub(super) fn parse_mesh(bytes: &[u8], place: &str) -> Result<Mesh> {
    mesh(content(bytes, place)?).checked(place)
}

fn mesh(content: body::Content) -> Mesh {
    // An index out of range is reported by `Mesh::checked`.
    let uv = |i: u32| content.uv.get(i as usize).copied().unwrap_or_default();
    let triangles = if content.uv.is_empty() {
        &[]
    } else {
        content.triangles.as_slice()
    };
    Mesh {
        uv: triangles.iter().map(|t| t.map(uv)).collect(),
        vertices: content.vertices,
        triangles: content.triangles,
        colours: content.colours,
    }
}

fn parse(bytes: &[u8], place: &str) -> Result<Ply> {
    let content = content(bytes, place)?;
    if content.triangles.is_empty() {
        return cloud(content, place).map(Ply::Cloud);
    }
    mesh(content).checked(place).map(Ply::Mesh)
}

fn content(bytes: &[u8], place: &str) -> Result<body::Content> {
    let mut rest = bytes;
    let header = header::read(&mut rest, place)?;
    body::read(&header, rest, place)
}

fn cloud(content: body::Content, place: &str) -> Result<Cloud> {
    let points: Vec<[f32; 3]> = content
        .vertices
        .iter()
        .map(|v| v.as_vec3().to_array())
        .collect();
    if points.is_empty() {
        return Err(Error::input(place, "no point", "at least one point"));
    }
    if !points.iter().any(|p| p.iter().all(|x| x.is_finite())) {
        return Err(Error::input(
            place,
            format!("{} points, none of them finite", points.len()),
            "at least one finite point",
        ));
    }
    Ok(Cloud {
        points,
        normals: content.normals,
        intensity: content.intensity,
        sigma_mm: content.sigma_mm,
    })
}
