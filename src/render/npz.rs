//! Archives of NumPy arrays (`.npz`).

use phasmid_core::npy;
use std::io::Write;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// An array of an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Array {
    /// Name.
    pub name: &'static str,
    /// NumPy's name of the element type, such as `<f4`.
    pub kind: &'static str,
    /// Shape.
    pub shape: Vec<usize>,
    /// Elements in C order, as bytes.
    pub bytes: Vec<u8>,
}

impl Array {
    /// Creates an array of float32 numbers.
    pub fn floats(name: &'static str, shape: &[usize], values: &[f32]) -> Self {
        Self {
            name,
            kind: "<f4",
            shape: shape.to_vec(),
            bytes: values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        }
    }
}

/// Writes an archive that `numpy.load` reads, without compression.
///
/// # Errors
/// Returns an error if writing to `out` fails.
pub fn write(out: impl Write, arrays: impl IntoIterator<Item = Array>) -> std::io::Result<()> {
    let mut archive = ZipWriter::new_stream(out);
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for array in arrays {
        archive.start_file(format!("{}.npy", array.name), options)?;
        archive.write_all(&npy::header(array.kind, &array.shape))?;
        archive.write_all(&array.bytes)?;
    }
    archive.finish()?;
    Ok(())
}
