//! Writes MetaImage files, little endian, with ITK's keys in ITK's order.

use crate::volume::{Field, Grid, Volume, Voxels};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::replace;
use phasmid_geometry::extension;
use std::io::Write;
use std::path::Path;

/// Compression of written data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Packing {
    /// Uncompressed.
    Plain,
    /// Compressed with zlib.
    Zlib,
}

/// Writes a volume to `.mha`, or to `.mhd` with its data in a `.raw` file (`.zraw` if compressed)
/// of the same name.
///
/// # Errors
/// Returns an error if the extension is another one or the files cannot be written.
pub fn write_volume(path: &Path, volume: &Volume, packing: Packing) -> Result<()> {
    match volume.voxels() {
        Voxels::I16(v) => write(path, volume.grid(), "MET_SHORT", 1, packing, |out| {
            put(out, v, i16::to_le_bytes)
        }),
        Voxels::F32(v) => write(path, volume.grid(), "MET_FLOAT", 1, packing, |out| {
            put(out, v, f32::to_le_bytes)
        }),
    }
}

/// Writes a displacement field, three `MET_FLOAT` per voxel, in the same files as [`write_volume`].
///
/// # Errors
/// Returns the errors of [`write_volume`].
pub fn write_field(path: &Path, field: &Field, packing: Packing) -> Result<()> {
    write(path, field.grid(), "MET_FLOAT", 3, packing, |out| {
        put(out, field.vectors().as_flattened(), f32::to_le_bytes)
    })
}

/// Writes an uncompressed integer volume without holding all of it in memory: `plane` returns the
/// values of each k, i fastest, then j.
///
/// # Errors
/// Returns the errors of [`write_volume`].
///
/// # Panics
/// Panics if a plane does not have the grid's number of values.
pub fn write_volume_by_planes(
    path: &Path,
    grid: &Grid,
    plane: impl Fn(usize) -> Vec<i16>,
) -> Result<()> {
    write(path, grid, "MET_SHORT", 1, Packing::Plain, |out| {
        planes(grid, &plane, |numbers| put(out, numbers, i16::to_le_bytes))
    })
}

/// Writes a displacement field plane by plane, like [`write_volume_by_planes`].
///
/// # Errors
/// Returns the errors of [`write_volume`].
///
/// # Panics
/// Panics like [`write_volume_by_planes`].
pub fn write_field_by_planes(
    path: &Path,
    grid: &Grid,
    plane: impl Fn(usize) -> Vec<[f32; 3]>,
) -> Result<()> {
    write(path, grid, "MET_FLOAT", 3, Packing::Plain, |out| {
        planes(grid, &plane, |vectors| {
            put(out, vectors.as_flattened(), f32::to_le_bytes)
        })
    })
}

/// Writes one plane after the other.
fn planes<T>(
    grid: &Grid,
    plane: &impl Fn(usize) -> Vec<T>,
    mut put: impl FnMut(&[T]) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let [ni, nj, nk] = grid.size;
    (0..nk).try_for_each(|k| {
        let made = plane(k);
        assert_eq!(made.len(), ni * nj, "plane {k}");
        put(&made)
    })
}

/// Number of values converted to bytes at a time, since small writes are slow.
const PIECE: usize = 1 << 14;

fn put<T: Copy, const N: usize>(
    out: &mut dyn Write,
    numbers: &[T],
    bytes: impl Fn(T) -> [u8; N],
) -> std::io::Result<()> {
    let mut piece: Vec<[u8; N]> = Vec::with_capacity(PIECE.min(numbers.len()));
    numbers.chunks(PIECE).try_for_each(|some| {
        piece.clear();
        piece.extend(some.iter().map(|&number| bytes(number)));
        out.write_all(piece.as_flattened())
    })
}

fn write(
    path: &Path,
    grid: &Grid,
    element: &str,
    channels: usize,
    packing: Packing,
    numbers: impl Fn(&mut dyn Write) -> std::io::Result<()>,
) -> Result<()> {
    let packed = match packing {
        Packing::Plain => None,
        Packing::Zlib => {
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
            let done = numbers(&mut encoder).and_then(|()| encoder.finish());
            Some(done.map_err(|e| Error::io(path, e))?)
        }
    };
    let body = |out: &mut dyn Write| match &packed {
        Some(bytes) => out.write_all(bytes),
        None => numbers(out),
    };
    let head = |data: &str| {
        let packed = packed.as_ref().map(Vec::len);
        header(grid, element, channels, packed, data)
    };
    match extension(path).as_str() {
        "mha" => replace(path, |out| {
            out.write_all(head("LOCAL").as_bytes())?;
            body(out)
        }),
        "mhd" => {
            let data = path.with_extension(if packed.is_some() { "zraw" } else { "raw" });
            replace(&data, |out| body(out))?;
            let name = data.file_name().unwrap_or_default().to_string_lossy();
            replace(path, |out| out.write_all(head(&name).as_bytes()))
        }
        other => Err(Error::input(
            path.display(),
            format!("extension `{other}`"),
            ".mha or .mhd",
        )),
    }
}

fn header(
    grid: &Grid,
    element: &str,
    channels: usize,
    packed: Option<usize>,
    data: &str,
) -> String {
    let mut text = "ObjectType = Image\nNDims = 3\nBinaryData = True\n\
                    BinaryDataByteOrderMSB = False\n"
        .to_owned();
    match packed {
        Some(bytes) => {
            text += &format!("CompressedData = True\nCompressedDataSize = {bytes}\n");
        }
        None => text += "CompressedData = False\n",
    }
    let axes = grid.direction.to_cols_array().map(|x| x.to_string());
    let three = |v: DVec3| format!("{} {} {}", v.x, v.y, v.z);
    text += &format!("TransformMatrix = {}\n", axes.join(" "));
    text += &format!("Offset = {}\n", three(grid.origin_mm));
    text += "CenterOfRotation = 0 0 0\n";
    text += &format!("AnatomicalOrientation = {}\n", letters(grid));
    text += &format!("ElementSpacing = {}\n", three(grid.spacing_mm));
    let [ni, nj, nk] = grid.size;
    text += &format!("DimSize = {ni} {nj} {nk}\n");
    if channels > 1 {
        text += &format!("ElementNumberOfChannels = {channels}\n");
    }
    text + &format!("ElementType = {element}\nElementDataFile = {data}\n")
}

/// Returns the anatomical letters of the directions from which i, j and k come, by the nearest
/// patient axis: RAI for the axes of LPS.
fn letters(grid: &Grid) -> String {
    let mut taken = [false; 3];
    let mut letters = String::new();
    for axis in 0..3 {
        let towards = grid.direction.col(axis);
        let side = towards.abs().to_array();
        let nearest = (0..3).fold(0, |a, b| if side[b] > side[a] { b } else { a });
        taken[nearest] = true;
        let from = [['R', 'L'], ['A', 'P'], ['I', 'S']][nearest];
        letters.push(from[usize::from(towards[nearest] < 0.0)]);
    }
    if taken == [true; 3] {
        letters
    } else {
        "???".to_owned()
    }
}
