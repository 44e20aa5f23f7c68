//! Ledger of a host's requests, which checks that the protocol allows every reply.

use phasmid::protocol::usb::usbip::{
    Command, HEADER_LEN, PACKET_LEN, Packet, Reply, Submit, status,
};
use std::collections::HashMap;

/// Unanswered commands, and bytes that do not form a complete command or reply yet.
#[derive(Default)]
pub struct Ledger {
    open: HashMap<u32, Submit>,
    unlinks: HashMap<u32, u32>,
    sent: Vec<u8>,
    received: Vec<u8>,
    /// Whether the host has sent an invalid command or reused a number, so that replies can no
    /// longer be checked.
    lost: bool,
}

impl Ledger {
    /// Returns whether replies can no longer be checked.
    pub fn is_lost(&self) -> bool {
        self.lost
    }

    /// Records bytes that the host sends.
    pub fn sent(&mut self, bytes: &[u8]) {
        self.sent.extend(bytes);
        while let Some((header, rest)) = self.sent.split_first_chunk::<HEADER_LEN>() {
            let Ok(command) = Command::decode(header) else {
                self.lost = true;
                return;
            };
            let mut len = HEADER_LEN;
            if let Command::Submit(submit) = command {
                let data = if submit.input { 0 } else { submit.length };
                let behind = data as usize + submit.packets.unwrap_or(0) as usize * PACKET_LEN;
                if rest.len() < behind {
                    return;
                }
                len += behind;
            }
            let (seqnum, twice) = match command {
                Command::Submit(submit) => (
                    submit.seqnum,
                    self.open.insert(submit.seqnum, submit).is_some(),
                ),
                Command::Unlink { seqnum, target } => {
                    (seqnum, self.unlinks.insert(seqnum, target).is_some())
                }
            };
            let both = self.open.contains_key(&seqnum) && self.unlinks.contains_key(&seqnum);
            self.lost |= twice || both;
            self.sent.drain(..len);
        }
    }

    /// Records bytes that the device sends; returns the replies that are now complete.
    pub fn received(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.received.extend(bytes);
        let mut whole = Vec::new();
        while !self.lost
            && let Some(len) = self.reply()
        {
            whole.push(self.received.drain(..len).collect());
        }
        whole
    }

    /// Checks the first complete reply and returns its length.
    fn reply(&mut self) -> Option<usize> {
        let (header, rest) = self.received.split_first_chunk::<HEADER_LEN>()?;
        match Reply::decode(header).expect("a valid reply") {
            Reply::Unlink { seqnum, status } => {
                let target = self.unlinks.remove(&seqnum).expect("an unlink was sent");
                let held = self.open.remove(&target).is_some();
                assert_eq!(
                    status,
                    if held { status::UNLINKED } else { status::OK },
                    "of a transfer {}",
                    if held { "without a reply" } else { "with one" }
                );
                Some(HEADER_LEN)
            }
            Reply::Submit {
                seqnum,
                actual,
                packets,
                ..
            } => {
                let submit = *self.open.get(&seqnum).expect("the transfer is pending");
                assert!(actual <= submit.length, "the data exceeds the transfer");
                assert_eq!(
                    packets, submit.packets,
                    "the number of packets is as requested"
                );
                let data = if submit.input { actual as usize } else { 0 };
                let table = rest.get(data..data + packets.unwrap_or(0) as usize * PACKET_LEN)?;
                let table = table.as_chunks::<PACKET_LEN>().0;
                let packets: Vec<Packet> = table.iter().map(Packet::decode).collect();
                assert!(packets.iter().all(|packet| packet.actual <= packet.length));
                if !packets.is_empty() {
                    let sum: u32 = packets.iter().map(|packet| packet.actual).sum();
                    assert_eq!(sum, actual, "the packets add up to the transfer");
                }
                self.open.remove(&seqnum);
                Some(HEADER_LEN + data + size_of_val(table))
            }
        }
    }
}
