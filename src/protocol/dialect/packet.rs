//! Packet layout.

use super::Direction;
use super::checksum::Checksum;
use super::file::{CodeFile, FlagsFile, LengthFile};

/// The layout of a dialect's packets.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// Length of every packet in bytes, if it is fixed.
    pub(super) size: Option<usize>,
    /// Maximum length of a packet in bytes.
    pub(super) max: usize,
    pub(super) start: Vec<u8>,
    pub(super) flags: Option<FlagsFile>,
    pub(super) sequence: Option<usize>,
    pub(super) length: Option<LengthFile>,
    pub(super) code: CodeFile,
    pub(super) data_at: usize,
    pub(super) reply_code: bool,
    pub(super) reply_data_at: usize,
    pub(super) big: bool,
    pub(super) checksum: Option<Checksum>,
}

/// Result of reading the start of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Extent {
    /// More bytes are needed to decide.
    More,
    /// Total length in bytes, and end of the data.
    Whole { len: usize, data_end: usize },
    /// Not the start of a packet.
    None,
}

/// A parsed packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Opened<'a> {
    pub(super) flags: u8,
    pub(super) sequence: u8,
    pub(super) code: Option<u32>,
    pub(super) data: &'a [u8],
}

impl Layout {
    fn data_at(&self, direction: Direction) -> usize {
        match direction {
            Direction::ToDevice => self.data_at,
            Direction::ToHost => self.reply_data_at,
        }
    }

    fn has_code(&self, direction: Direction) -> bool {
        direction == Direction::ToDevice || self.reply_code
    }

    fn checksum_len(&self) -> usize {
        self.checksum.map_or(0, Checksum::len)
    }

    /// Returns the maximum number of data bytes in a packet.
    pub(super) fn room(&self, direction: Direction) -> usize {
        let counted = self.length.map_or(usize::MAX, |length| {
            let most = (1u64 << (8 * length.bytes.min(4))) - 1;
            length.from + most as usize
        });
        let end = (self.max - self.checksum_len()).min(counted);
        end.saturating_sub(self.data_at(direction))
    }

    /// Returns the mask of all flag bits with a meaning.
    fn known_flags(flags: &FlagsFile) -> u8 {
        [flags.read, flags.reply, flags.error]
            .into_iter()
            .flatten()
            .fold(0, |mask, bit| mask | 1 << bit)
    }

    /// Reads a number of up to four bytes.
    fn number(&self, bytes: &[u8]) -> u32 {
        let digit = |number: u32, byte: &u8| number << 8 | u32::from(*byte);
        match self.big {
            true => bytes.iter().fold(0, digit),
            false => bytes.iter().rev().fold(0, digit),
        }
    }

    fn put(&self, number: u32, place: &mut [u8]) {
        let bytes = number.to_le_bytes();
        place.copy_from_slice(&bytes[..place.len()]);
        if self.big {
            place.reverse();
        }
    }

    /// Returns the extent of the packet that starts with `head`.
    pub(super) fn extent(&self, head: &[u8], direction: Direction) -> Extent {
        let known = head.len().min(self.start.len());
        if head[..known] != self.start[..known] {
            return Extent::None;
        }
        if let Some(flags) = &self.flags
            && let Some(byte) = head.get(flags.at)
        {
            // A request with the error flag set is invalid.
            let error = flags.error.filter(|_| direction == Direction::ToDevice);
            let mask = Self::known_flags(flags) & !error.map_or(0, |bit| 1 << bit);
            if byte & !mask != 0 {
                return Extent::None;
            }
        }
        let data_at = self.data_at(direction);
        let last = self.max - self.checksum_len();
        let data_end = match self.length {
            None => last,
            Some(length) => {
                let Some(bytes) = head.get(length.at..length.at + length.bytes) else {
                    return Extent::More;
                };
                let end = (self.number(bytes) as usize).saturating_add(length.from);
                if !(data_at..=last).contains(&end) {
                    return Extent::None;
                }
                end
            }
        };
        if head.len() < data_at {
            return Extent::More;
        }
        let len = self.size.unwrap_or(data_end + self.checksum_len());
        Extent::Whole { len, data_end }
    }

    /// Parses a packet.
    ///
    /// # Errors
    /// Returns an error that describes the defect.
    pub(super) fn open<'a>(
        &self,
        packet: &'a [u8],
        direction: Direction,
    ) -> Result<Opened<'a>, String> {
        let Extent::Whole { len, data_end } = self.extent(packet, direction) else {
            return Err(format!("{} bytes that are not a packet", packet.len()));
        };
        if packet.len() != len {
            return Err(format!("a packet of {len} bytes in {} bytes", packet.len()));
        }
        if let Some(checksum) = self.checksum {
            let (covered, told) = packet.split_at(len - checksum.len());
            if checksum.of(covered) != self.number(told) {
                return Err("the checksum does not match".to_owned());
            }
        }
        let code = &self.code;
        Ok(Opened {
            flags: self.flags.map_or(0, |flags| packet[flags.at]),
            sequence: self.sequence.map_or(0, |at| packet[at]),
            code: self
                .has_code(direction)
                .then(|| self.number(&packet[code.at..code.at + code.bytes])),
            data: &packet[self.data_at(direction)..data_end],
        })
    }

    /// Builds a packet; `None` if the data do not fit.
    pub(super) fn seal(
        &self,
        direction: Direction,
        (flags, sequence, code): (u8, u8, u32),
        data: &[u8],
    ) -> Option<Vec<u8>> {
        if data.len() > self.room(direction) {
            return None;
        }
        let data_at = self.data_at(direction);
        let data_end = data_at + data.len();
        let checksum_len = self.checksum_len();
        let len = self.size.unwrap_or(data_end + checksum_len);
        let mut packet = vec![0; len];
        packet[..self.start.len()].copy_from_slice(&self.start);
        if let Some(place) = &self.flags {
            packet[place.at] = flags;
        }
        if let Some(at) = self.sequence {
            packet[at] = sequence;
        }
        if self.has_code(direction) {
            let place = self.code.at..self.code.at + self.code.bytes;
            self.put(code, &mut packet[place]);
        }
        if let Some(length) = &self.length {
            let place = length.at..length.at + length.bytes;
            self.put((data_end - length.from) as u32, &mut packet[place]);
        }
        packet[data_at..data_end].copy_from_slice(data);
        if let Some(checksum) = self.checksum {
            let sum = checksum.of(&packet[..len - checksum_len]);
            self.put(sum, &mut packet[len - checksum_len..]);
        }
        Some(packet)
    }

    /// Returns the flags of a packet.
    pub(super) fn flags(&self, read: bool, reply: bool, error: bool) -> u8 {
        let bit = |set: bool, bit: Option<u8>| bit.filter(|_| set).map_or(0, |bit| 1 << bit);
        self.flags.map_or(0, |flags| {
            bit(read, flags.read) | bit(reply, flags.reply) | bit(error, flags.error)
        })
    }
}
