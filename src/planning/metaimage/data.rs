//! Reads the data of a MetaImage in pieces, and decompresses it.

use super::header::{Header, Packed, Skip};
use flate2::read::ZlibDecoder;
use phasmid_core::error::{Error, Result};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Take};

/// Size of a piece in bytes, a multiple of three values of any type.
const PIECE: usize = 24 << 13;

/// Maximum expansion of deflate: 1032 (<https://zlib.net/zlib_tech.html>).
const MOST_UNPACKED: u64 = 1032;

/// The data of a file. Opening it checks that the data has the length that the header declares or, if
/// compressed, can expand to it, so no memory is allocated for missing data.
pub(super) struct Data<'a> {
    header: &'a Header,
    source: Take<BufReader<File>>,
}

impl<'a> Data<'a> {
    /// Opens the data file and seeks to the start of the data.
    pub(super) fn open(header: &'a Header) -> Result<Self> {
        let path = &header.data;
        let io = |e| Error::io(path, e);
        let named = |e: Error| e.at(format!("{}: ElementDataFile", header.place));
        let length = phasmid_core::file::regular(path).map_err(named)?.len();
        let declared = header.bytes();
        let wanted = match header.packed {
            Packed::No => Some(declared),
            Packed::Zlib(packed) => packed,
        };
        let from = match header.skip {
            Skip::Bytes(n) => n,
            Skip::AllButTheData => wanted.map_or(0, |n| length.saturating_sub(n)),
        };
        let mut there = length.saturating_sub(from);
        if let (Packed::Zlib(_), Some(n)) = (header.packed, wanted) {
            if n > there {
                let allowed = format!("{n}, as in CompressedDataSize");
                let found = format!("{there} bytes of packed data");
                return Err(Error::input(path.display(), found, allowed));
            }
            there = n;
        }
        let enough = match header.packed {
            Packed::No => there == declared,
            Packed::Zlib(_) => declared <= there.saturating_mul(MOST_UNPACKED),
        };
        if !enough {
            let packed = ["", " packed"][usize::from(header.packed != Packed::No)];
            return Err(wrong(header, format!("{there} bytes of{packed} data")));
        }
        let mut file = File::open(path).map_err(io)?;
        file.seek(SeekFrom::Start(from)).map_err(io)?;
        let source = BufReader::with_capacity(1 << 18, file).take(there);
        Ok(Self { header, source })
    }

    /// Passes all data to `take`, in order, in pieces of whole triples of values.
    pub(super) fn read(self, mut take: impl FnMut(&[u8])) -> Result<()> {
        let (header, declared) = (self.header, self.header.bytes());
        let mut source = self.source;
        let read = match header.packed {
            Packed::No => {
                pieces(&mut source, declared, &mut take).map_err(|e| Error::io(&header.data, e))?
            }
            Packed::Zlib(_) => {
                let mut unpacked = ZlibDecoder::new(source);
                // Read one more byte, to detect surplus data and verify the stream's checksum.
                pieces(&mut unpacked, declared, &mut take)
                    .and_then(|read| Ok(read + unpacked.read(&mut [0])? as u64))
                    .map_err(|e| {
                        Error::input(
                            header.data.display(),
                            format!("packed data that cannot be unpacked ({e})"),
                            "a whole zlib stream",
                        )
                    })?
            }
        };
        if read == declared {
            return Ok(());
        }
        let found = if read > declared {
            format!("more than {declared} bytes of data")
        } else {
            format!("{read} bytes of data")
        };
        Err(wrong(header, found))
    }
}

/// Reads at most `most` bytes in pieces; returns the number of bytes read.
fn pieces(source: &mut impl Read, most: u64, take: &mut impl FnMut(&[u8])) -> std::io::Result<u64> {
    let mut piece = vec![0; PIECE];
    let mut done = 0;
    while done < most {
        let want = PIECE.min((most - done) as usize);
        let mut filled = 0;
        while filled < want {
            match source.read(&mut piece[filled..want])? {
                0 => return Ok(done + filled as u64),
                n => filled += n,
            }
        }
        take(&piece[..want]);
        done += want as u64;
    }
    Ok(done)
}

fn wrong(header: &Header, found: String) -> Error {
    let [ni, nj, nk] = header.grid.size;
    let (channels, bytes, all) = (header.channels, header.element.bytes(), header.bytes());
    let sizes = format!("{ni} x {nj} x {nk} voxels x {channels} x {bytes} bytes = {all} bytes");
    Error::input(header.data.display(), found, sizes)
}
