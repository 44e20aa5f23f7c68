//! Definite-length arbitrary block data (IEEE 488.2, 7.7.6.2 and 8.7.9): `#`, one digit that gives
//! the number of length digits, the length digits, and that many bytes.

/// Result of parsing a block's prefix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prefix {
    /// More bytes are needed to decide.
    Incomplete,
    /// Not a definite-length block.
    Invalid,
    /// A valid prefix.
    Block {
        /// Length of the prefix: `#`, the digit and the length digits.
        prefix: usize,
        /// Length of the content.
        len: usize,
    },
}

/// Parses the prefix of a block that starts at `bytes[0]`.
pub fn header(bytes: &[u8]) -> Prefix {
    match bytes {
        [] | [b'#'] => Prefix::Incomplete,
        [b'#', digit @ b'1'..=b'9', rest @ ..] => {
            let digits = usize::from(digit - b'0');
            let have = &rest[..digits.min(rest.len())];
            if !have.iter().all(u8::is_ascii_digit) {
                Prefix::Invalid
            } else if have.len() < digits {
                Prefix::Incomplete
            } else {
                Prefix::Block {
                    prefix: 2 + digits,
                    len: have
                        .iter()
                        .fold(0, |n, digit| n * 10 + usize::from(digit - b'0')),
                }
            }
        }
        _ => Prefix::Invalid,
    }
}

/// Splits a complete block at the start of `bytes` into its content and the bytes that follow.
pub fn split(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let Prefix::Block { prefix, len } = header(bytes) else {
        return None;
    };
    bytes.get(prefix..)?.split_at_checked(len)
}

/// Encodes `content` as a block; the format limits the length to 999,999,999 bytes.
pub fn encode(content: &[u8]) -> Vec<u8> {
    let len = content.len().to_string();
    debug_assert!(len.len() <= 9);
    let mut block = format!("#{}{len}", len.len()).into_bytes();
    block.extend_from_slice(content);
    block
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn block_reads_back_and_malformed_blocks_are_refused() {
        for content in [&b""[..], b"a\n;\"#", &[0u8; 1234]] {
            let mut bytes = encode(content);
            bytes.extend_from_slice(b"tail");
            assert_eq!(split(&bytes), Some((content, &b"tail"[..])));
            assert_eq!(split(&bytes[..bytes.len() - 5]), None);
        }
        for bad in ["#", "#0", "#0abc", "#A12", "#2x1", "12", "#15ab"] {
            assert_eq!(split(bad.as_bytes()), None, "{bad}");
        }
        assert_eq!(header(b"#3"), Prefix::Incomplete);
        assert_eq!(header(b"#31"), Prefix::Incomplete);
        assert_eq!(header(b"#3a"), Prefix::Invalid);
    }
}
