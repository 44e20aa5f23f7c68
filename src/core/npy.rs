//! Writes NumPy's array file, version 1.0: magic, version, little-endian header length, a Python
//! dictionary padded with spaces to a multiple of 64 bytes and ended by a newline, then the numbers
//! in C order (NumPy enhancement proposal 1, "A Simple File Format for NumPy Arrays").

use crate::error::Result;
use crate::new_file::replace;
use std::io::Write;
use std::path::Path;

/// Writes float32 values as an array of shape (height, width).
///
/// # Errors
/// Returns an error if the file cannot be written.
///
/// # Panics
/// Panics if the number of values is not width x height.
pub fn write_npy(path: &Path, width: usize, height: usize, values: &[f32]) -> Result<()> {
    assert_eq!(values.len(), width * height);
    let mut bytes = header("<f4", &[height, width]);
    bytes.reserve(4 * values.len());
    for v in values {
        bytes.extend_from_slice(&v.to_le_bytes());
    }
    replace(path, |out| out.write_all(&bytes))
}

/// Returns the header of an array of two or more dimensions; `kind` is NumPy's name of the type of its numbers, such as `<f4`.
pub fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let dictionary = format!(
        "{{'descr': '{kind}', 'fortran_order': False, 'shape': ({}), }}",
        shape.join(", ")
    );
    // Magic, version and length take 10 bytes, and the newline takes one.
    let total = (10 + dictionary.len() + 1).next_multiple_of(64);
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend_from_slice(&((total - 10) as u16).to_le_bytes());
    bytes.extend_from_slice(dictionary.as_bytes());
    bytes.resize(total - 1, b' ');
    bytes.push(b'\n');
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_is_as_the_proposal_says() {
        for (width, height) in [(1, 1), (1138, 489), (32768, 32768)] {
            let h = header("<f4", &[height, width]);
            assert_eq!(h.len() % 64, 0);
            assert_eq!(&h[..8], b"\x93NUMPY\x01\x00");
            assert_eq!(usize::from(u16::from_le_bytes([h[8], h[9]])), h.len() - 10);
            let text = std::str::from_utf8(&h[10..]).unwrap();
            assert!(
                text.contains(&format!("'shape': ({height}, {width})")) && text.ends_with('\n')
            );
        }
    }

    #[test]
    fn values_follow_row_by_row() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        write_npy(&path, 3, 2, &[1.0, 2.0, 3.0, 4.0, 5.0, f32::NAN]).unwrap();
        let bytes = std::fs::read(path).unwrap();
        let body = &bytes[bytes.len() - 24..];
        assert_eq!(body[..8], [0, 0, 128, 63, 0, 0, 0, 64]);
    }
}
