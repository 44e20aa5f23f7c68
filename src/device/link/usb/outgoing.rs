//! Replies queued for the host: owned headers and control data, and slices of frames, which are
//! never copied between sensor and socket.

use phasmid_protocol::Frame;
use phasmid_protocol::usb::usbip::{HEADER_LEN, Packet, Reply, Submit, status};
use phasmid_protocol::usb::uvc::payload;
use std::collections::VecDeque;
use std::io::IoSlice;
use std::ops::Range;
use std::sync::Arc;

/// Size of a reply header followed by a payload header.
const HEAD_LEN: usize = HEADER_LEN + payload::HEADER_LEN;

enum Chunk {
    Head([u8; HEAD_LEN], usize),
    Bytes(Vec<u8>),
    Frame(Arc<Frame>, Range<usize>),
}

impl Chunk {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Head(bytes, len) => &bytes[..*len],
            Self::Bytes(bytes) => bytes,
            Self::Frame(frame, range) => &frame.data[range.clone()],
        }
    }
}

/// Chunks to be written to the socket, in order.
#[derive(Default)]
pub(super) struct Outgoing {
    chunks: VecDeque<Chunk>,
    /// Number of bytes of the first chunk that have been written.
    written: usize,
}

impl Outgoing {
    pub(super) fn is_empty(&self) -> bool {
        self.chunks.is_empty()
    }

    /// Returns the number of queued chunks.
    pub(super) fn len(&self) -> usize {
        self.chunks.len()
    }

    /// Moves all chunks of `other` to the end of this queue.
    pub(super) fn append(&mut self, other: &mut Self) {
        debug_assert_eq!(
            other.written, 0,
            "nothing is written from a session's own queue"
        );
        self.chunks.append(&mut other.chunks);
    }

    /// Replies that a transfer has ended, with its data for the host.
    pub(super) fn submitted(&mut self, seqnum: u32, status: i32, data: Vec<u8>) {
        self.head(seqnum, status, data.len() as u32, None);
        self.bytes(data);
    }

    /// Replies that a transfer of `actual` bytes has ended, without data for the host.
    pub(super) fn received(&mut self, seqnum: u32, status: i32, actual: u32) {
        self.head(seqnum, status, actual, None);
    }

    /// Replies that a transfer has failed; for an isochronous transfer, all its packets fail as
    /// well.
    pub(super) fn failed(&mut self, submit: &Submit, packets: &[Packet], status: i32) {
        let reply = Reply::Submit {
            seqnum: submit.seqnum,
            status,
            actual: 0,
            packets: submit.packets,
            errors: packets.len() as u32,
        };
        self.push_head(&reply, None);
        let failed = |packet: &Packet| Packet {
            actual: 0,
            status,
            ..*packet
        };
        let packets: Vec<Packet> = packets.iter().map(failed).collect();
        self.packets(&packets);
    }

    /// Replies that a transfer has completed with a payload, which is a header and a range of a
    /// frame.
    pub(super) fn payload(
        &mut self,
        seqnum: u32,
        info: u8,
        frame: &Arc<Frame>,
        part: Range<usize>,
    ) {
        let actual = (payload::HEADER_LEN + part.len()) as u32;
        self.head(seqnum, status::OK, actual, Some(info));
        if !part.is_empty() {
            self.chunks.push_back(Chunk::Frame(frame.clone(), part));
        }
    }

    /// Starts the reply to an isochronous transfer with the reply's header; the caller then adds
    /// [`Self::packet`] and [`Self::packets`].
    pub(super) fn isochronous(&mut self, seqnum: u32, actual: u32, packets: u32) {
        let reply = Reply::Submit {
            seqnum,
            status: status::OK,
            actual,
            packets: Some(packets),
            errors: 0,
        };
        self.push_head(&reply, None);
    }

    /// Adds the payload of one packet.
    pub(super) fn packet(&mut self, info: u8, frame: &Arc<Frame>, part: Range<usize>) {
        self.bytes(vec![payload::HEADER_LEN as u8, info]);
        if !part.is_empty() {
            self.chunks.push_back(Chunk::Frame(frame.clone(), part));
        }
    }

    /// Adds the packet descriptors, which follow the data of an isochronous transfer.
    pub(super) fn packets(&mut self, packets: &[Packet]) {
        self.bytes(packets.iter().flat_map(Packet::encode).collect());
    }

    /// Replies to an unlink command.
    pub(super) fn unlinked(&mut self, seqnum: u32, status: i32) {
        self.push_head(&Reply::Unlink { seqnum, status }, None);
    }

    fn head(&mut self, seqnum: u32, status: i32, actual: u32, info: Option<u8>) {
        let reply = Reply::Submit {
            seqnum,
            status,
            actual,
            packets: None,
            errors: 0,
        };
        self.push_head(&reply, info);
    }

    fn push_head(&mut self, reply: &Reply, info: Option<u8>) {
        let mut bytes = [0; HEAD_LEN];
        bytes[..HEADER_LEN].copy_from_slice(&reply.encode());
        let mut len = HEADER_LEN;
        if let Some(info) = info {
            bytes[HEADER_LEN..].copy_from_slice(&[payload::HEADER_LEN as u8, info]);
            len = HEAD_LEN;
        }
        self.chunks.push_back(Chunk::Head(bytes, len));
    }

    fn bytes(&mut self, bytes: Vec<u8>) {
        if !bytes.is_empty() {
            self.chunks.push_back(Chunk::Bytes(bytes));
        }
    }

    /// Fills `slices` with the next chunks to write and returns the number of slices filled.
    pub(super) fn slices<'a>(&'a self, slices: &mut [IoSlice<'a>]) -> usize {
        let mut skip = self.written;
        let mut count = 0;
        for (slice, chunk) in slices.iter_mut().zip(&self.chunks) {
            *slice = IoSlice::new(&chunk.bytes()[skip..]);
            skip = 0;
            count += 1;
        }
        count
    }

    /// Removes the first `bytes` bytes, which have been written.
    pub(super) fn advance(&mut self, mut bytes: usize) {
        while let Some(first) = self.chunks.front() {
            let left = first.bytes().len() - self.written;
            if bytes < left {
                self.written += bytes;
                return;
            }
            bytes -= left;
            self.written = 0;
            self.chunks.pop_front();
        }
    }
}
