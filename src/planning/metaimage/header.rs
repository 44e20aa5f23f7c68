//! The text header: lines `Key = Value`, ending with `ElementDataFile`.

use super::element::{ALLOWED, Element};
use super::lines::{Lines, shown};
use crate::volume::Grid;
use glam::{DMat3, DVec3};
use phasmid_core::error::{Error, Result};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Maximum length of a header; ITK copies a study's complete dictionary into it.
const LONGEST_HEADER: u64 = 1 << 20;

/// Maximum number of values in a file, equal to the maximum number of voxels of a volume.
const MOST_NUMBERS: u64 = 1 << 28;

/// Content of a header.
#[derive(Debug)]
pub(super) struct Header {
    /// The header's file, for messages.
    pub(super) place: String,
    pub(super) grid: Grid,
    /// Values per voxel.
    pub(super) channels: usize,
    pub(super) element: Element,
    pub(super) big_endian: bool,
    pub(super) packed: Packed,
    /// File with the data.
    pub(super) data: PathBuf,
    pub(super) skip: Skip,
}

/// Compression of the data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Packed {
    No,
    /// zlib, with the compressed size in bytes if the header states it.
    Zlib(Option<u64>),
}

/// Where the data starts in its file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Skip {
    Bytes(u64),
    /// The data is at the end of the file.
    AllButTheData,
}

impl Header {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path, e);
        phasmid_core::file::regular(path)?;
        let mut bytes = Vec::new();
        let file = File::open(path).map_err(io)?;
        file.take(LONGEST_HEADER)
            .read_to_end(&mut bytes)
            .map_err(io)?;
        parse(&bytes, path)
    }

    /// Size of the uncompressed data in bytes.
    pub(super) fn bytes(&self) -> u64 {
        (self.grid.voxels() * self.channels * self.element.bytes()) as u64
    }
}

fn parse(bytes: &[u8], path: &Path) -> Result<Header> {
    let (lines, end) = Lines::read(bytes, path)?;
    lines.is("ObjectType", "Image")?;
    let n_dims: usize = lines.number("NDims", "3")?.unwrap_or(3);
    if n_dims != 3 {
        let found = match n_dims {
            4 => "4: a series of volumes in one file".to_owned(),
            n => n.to_string(),
        };
        return Err(lines.wrong("NDims", found, "3: one volume per file"));
    }
    lines.is("BinaryData", "True")?;
    let grid = lines.grid()?;
    let channels = lines
        .number("ElementNumberOfChannels", "1 or 3")?
        .unwrap_or(1);
    if !matches!(channels, 1 | 3) {
        return Err(lines.wrong("ElementNumberOfChannels", channels, "1 or 3"));
    }
    if (grid.voxels() * channels) as u64 > MOST_NUMBERS {
        let allowed = format!("up to {MOST_NUMBERS} numbers in all");
        let found = format!("{} voxels of {channels} numbers", grid.voxels());
        return Err(lines.wrong("DimSize", found, allowed));
    }
    let element = lines.needed("ElementType")?;
    let element = Element::named(element)
        .ok_or_else(|| lines.wrong("ElementType", shown(element), ALLOWED))?;
    let big_endian = lines
        .flag(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"])?
        .unwrap_or(false);
    let packed = if lines.flag(&["CompressedData"])?.unwrap_or(false) {
        Packed::Zlib(lines.number("CompressedDataSize", "a number of bytes")?)
    } else {
        Packed::No
    };
    let (data, skip) = lines.data(path, end)?;
    Ok(Header {
        place: lines.place,
        grid,
        channels,
        element,
        big_endian,
        packed,
        data,
        skip,
    })
}

impl Lines<'_> {
    fn grid(&self) -> Result<Grid> {
        let Some((_, size)) = self.numbers::<usize, 3>(&["DimSize"])? else {
            return Err(Error::input(&self.place, "no DimSize", "three numbers"));
        };
        // Next to a spacing, ElementSize is the extent of a voxel rather than the distance of
        // voxels.
        let spacing = match self.numbers::<f64, 3>(&["ElementSpacing"])? {
            None => self.numbers(&["ElementSize"])?,
            spacing => spacing,
        };
        let Some((_, spacing)) = spacing else {
            return Err(Error::input(
                &self.place,
                "no ElementSpacing",
                "three numbers, in millimetres",
            ));
        };
        let origin = self.numbers(&["Offset", "Origin", "Position"])?;
        let axes = self.numbers::<f64, 9>(&["TransformMatrix", "Rotation", "Orientation"])?;
        self.orientation(axes.is_some())?;
        let grid = Grid {
            size,
            spacing_mm: DVec3::from_array(spacing),
            origin_mm: origin.map_or(DVec3::ZERO, |(_, mm)| DVec3::from_array(mm)),
            direction: axes.map_or(DMat3::IDENTITY, |(_, columns)| {
                DMat3::from_cols_array(&columns)
            }),
        };
        grid.checked(&self.place)
    }

    /// Checks the anatomical letters. As in ITK, a matrix overrides them. Without a matrix, letters
    /// other than RAI are rejected, because programs interpret them differently.
    fn orientation(&self, has_axes: bool) -> Result<()> {
        let key = "AnatomicalOrientation";
        match self.get(key)? {
            Some(letters) if !has_axes && !matches!(letters, "RAI" | "???") => Err(self.wrong(
                key,
                format!("{} without a TransformMatrix", shown(letters)),
                "RAI, or a TransformMatrix as well",
            )),
            _ => Ok(()),
        }
    }

    fn data(&self, path: &Path, end: u64) -> Result<(PathBuf, Skip)> {
        let key = "ElementDataFile";
        let name = self.needed(key)?;
        let before: Option<i64> = self.number("HeaderSize", "-1, or a number of bytes")?;
        if name.eq_ignore_ascii_case("local") {
            return match before {
                None | Some(0) => Ok((path.to_owned(), Skip::Bytes(end))),
                Some(n) => Err(self.wrong("HeaderSize", n, "0 for LOCAL data")),
            };
        }
        if name.is_empty() || name.split_whitespace().next() == Some("LIST") || name.contains('%') {
            return Err(self.wrong(
                key,
                shown(name),
                "LOCAL or the name of one file (slices in files of their own are not read)",
            ));
        }
        let skip = match before {
            None => Skip::Bytes(0),
            Some(-1) => Skip::AllButTheData,
            Some(n) => Skip::Bytes(u64::try_from(n).map_err(|_| {
                self.wrong(
                    "HeaderSize",
                    n,
                    "-1 (the data are last), or 0 or more bytes",
                )
            })?),
        };
        Ok((path.with_file_name("").join(name), skip))
    }
}
