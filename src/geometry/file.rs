//! Reads geometry files as bytes, up to a size limit, and splits text lines.

use phasmid_core::error::Result;
use std::path::Path;

/// Maximum size of a mesh or cloud file: about 20 million triangles of binary STL.
pub(crate) const MAX_BYTES: u64 = 1 << 30;

/// Reads a regular file of at most [`MAX_BYTES`].
///
/// # Errors
/// Returns an error if the file cannot be read, is not a regular file or is larger.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>> {
    phasmid_core::file::read(path, MAX_BYTES)
}

/// Removes the next line from `rest` and returns it without its terminator (LF, CR LF or CR);
/// `None` at the end of the file.
pub fn next_line<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    if rest.is_empty() {
        return None;
    }
    let end = rest
        .iter()
        .position(|&b| b == b'\n' || b == b'\r')
        .unwrap_or(rest.len());
    let line = &rest[..end];
    let mut skip = (end + 1).min(rest.len());
    if rest.get(end) == Some(&b'\r') && rest.get(end + 1) == Some(&b'\n') {
        skip += 1;
    }
    *rest = &rest[skip..];
    Some(line)
}

/// Splits a line into its whitespace-separated words.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|b| b.is_ascii_whitespace())
        .filter(|w| !w.is_empty())
}

/// Parses a word as a number.
pub(crate) fn number<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Returns a word for use in a message: at most 40 characters, all printable.
pub fn quoted(word: &[u8]) -> String {
    let text: String = String::from_utf8_lossy(&word[..word.len().min(160)])
        .chars()
        .take(40)
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect();
    format!("`{text}`")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_lines_at_lf_crlf_and_cr() {
        let mut rest: &[u8] = b"a\nb\r\nc\rd";
        let lines: Vec<_> = std::iter::from_fn(|| next_line(&mut rest)).collect();
        assert_eq!(lines, [b"a", b"b", b"c", b"d"]);
    }

    #[test]
    fn refuses_folder_as_mesh() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(read(dir.path()).unwrap_err().exit_code(), 2);
    }
}
