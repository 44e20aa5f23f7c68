//! The reading end of a connection, which reads payloads directly into their destination.
//!
//! A stream of replies alternates short headers with long data. One system call reads the rest of a
//! reply's data into its destination and the next header into a small buffer, so a reply takes one
//! call and its data is never copied.

use std::io::{IoSliceMut, Read, Result};

/// Buffer size in bytes: a reply header and the video payload header that follows it.
const STORE_LEN: usize = 64;
/// Reads of at least this many bytes bypass the buffer.
const DIRECT_LEN: usize = 1024;

/// A stream with a small read buffer.
pub(super) struct Inlet<R> {
    stream: R,
    store: [u8; STORE_LEN],
    /// Start of the unread part of the buffer; `end` is the end of that part.
    begin: usize,
    end: usize,
}

impl<R: Read> Inlet<R> {
    pub(super) fn new(stream: R) -> Self {
        Self {
            stream,
            store: [0; STORE_LEN],
            begin: 0,
            end: 0,
        }
    }
}

impl<R: Read> Read for Inlet<R> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if self.begin == self.end {
            let len = buffer.len();
            if len >= DIRECT_LEN {
                let mut places = [IoSliceMut::new(buffer), IoSliceMut::new(&mut self.store)];
                let got = self.stream.read_vectored(&mut places)?;
                (self.begin, self.end) = (0, got.saturating_sub(len));
                return Ok(got.min(len));
            }
            // Read only once: waiting until the buffer is full could block for a long time.
            let got = self.stream.read(&mut self.store)?;
            (self.begin, self.end) = (0, got);
        }
        let len = buffer.len().min(self.end - self.begin);
        buffer[..len].copy_from_slice(&self.store[self.begin..self.begin + len]);
        self.begin += len;
        Ok(len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns at most `step` bytes at a time.
    struct Slow<'a>(&'a [u8], usize);

    impl Read for Slow<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
            let len = self.1.min(buffer.len());
            self.0.read(&mut buffer[..len])
        }

        fn read_vectored(&mut self, places: &mut [IoSliceMut<'_>]) -> Result<usize> {
            let (now, later) = self.0.split_at(self.0.len().min(self.1));
            let mut given = now;
            let got = given.read_vectored(places)?;
            self.0 = &self.0[got..];
            assert!(got <= now.len() && self.0.ends_with(later));
            Ok(got)
        }
    }

    #[test]
    fn bytes_come_in_order_whatever_the_lengths() {
        let bytes: Vec<u8> = (0..100_000u32)
            .map(|i| (i.wrapping_mul(i) >> 7) as u8)
            .collect();
        for step in [1, 63, 64, 65, 1500, 100_000] {
            let mut inlet = Inlet::new(Slow(&bytes, step));
            let mut got = Vec::new();
            for len in [48, 2, 5000, 48, 1024, 1, 0, 20_000, 1023, 50].repeat(10) {
                let mut piece = vec![0; len];
                if inlet.read_exact(&mut piece).is_err() {
                    break;
                }
                got.extend(piece);
            }
            assert!(got.len() > 70_000 && bytes.starts_with(&got), "{step}");
        }
    }
}
