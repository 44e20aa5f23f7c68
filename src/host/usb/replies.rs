//! The thread that reads a connection and hands each reply to its receiver.

use super::connection::{Connection, Done, Pending, lock, reason};
use super::inlet::Inlet;
use phasmid_protocol::usb::usbip::{HEADER_LEN, PACKET_LEN, Packet, Reply, status};
use std::io::{self, Read};
use std::net::TcpStream;

impl Connection {
    /// Reads replies until the connection ends.
    pub(super) fn read(&self, stream: TcpStream) {
        let mut inlet = Inlet::new(stream);
        // Release the transfer that was answered last only after recording why the connection
        // ended, because its waiter reads that reason.
        let mut answered = None;
        let why = loop {
            if let Err(error) = self.read_reply(&mut inlet, &mut answered) {
                break reason(&error);
            }
        };
        self.close(why);
        let pending = {
            let mut table = lock(&self.table);
            table.closed = true;
            table.unlinks.clear();
            std::mem::take(&mut table.pending)
        };
        self.settled.notify_all();
        for pending in pending.into_values().chain(answered) {
            lock(&pending.receiver).gone();
        }
    }

    /// Reads one reply. On return, `answered` holds the transfer that the reply completed.
    fn read_reply(
        &self,
        inlet: &mut Inlet<TcpStream>,
        answered: &mut Option<Pending>,
    ) -> io::Result<()> {
        let mut header = [0; HEADER_LEN];
        inlet.read_exact(&mut header)?;
        match Reply::decode(&header).map_err(io::Error::other)? {
            Reply::Submit {
                seqnum,
                status,
                actual,
                packets,
                ..
            } => {
                *answered = lock(&self.table).pending.remove(&seqnum);
                let Some(Pending { submit, receiver }) = answered else {
                    return Err(io::Error::other(format!(
                        "the server answered transfer {seqnum}, which was not submitted"
                    )));
                };
                if packets != submit.packets || actual > submit.length {
                    return Err(io::Error::other(format!(
                        "the server answered transfer {seqnum} with {actual} bytes in {packets:?} \
                         packets; expected at most {} in {:?}",
                        submit.length, submit.packets
                    )));
                }
                let mut done = Done {
                    seqnum,
                    status,
                    actual: actual as usize,
                    length: submit.length as usize,
                    packets: Vec::new(),
                };
                let room = if submit.input { actual } else { 0 };
                let again = match packets {
                    None => {
                        let mut data = inlet.take(room.into());
                        let again = lock(receiver).reply(&done, &mut data)?;
                        // Skip the data that the receiver has not read.
                        io::copy(&mut data, &mut io::sink())?;
                        again
                    }
                    Some(packets) => {
                        let mut data = vec![0; room as usize];
                        inlet.read_exact(&mut data)?;
                        done.packets = read_packets(inlet, packets, data.len())?;
                        lock(receiver).reply(&done, &mut &data[..])?
                    }
                };
                if again > 0 {
                    self.submit(submit, &[], again, receiver)
                        .map_err(io::Error::other)?;
                }
            }
            Reply::Unlink { seqnum, .. } => {
                let target = {
                    let mut table = lock(&self.table);
                    let target = table.unlinks.remove(&seqnum).ok_or_else(|| {
                        io::Error::other(format!(
                            "the server answered unlink {seqnum}, which was not submitted"
                        ))
                    })?;
                    *answered = table.pending.remove(&target);
                    target
                };
                if let Some(Pending { submit, receiver }) = answered {
                    // If a kernel exports the device, this status tells how the transfer ended
                    // before the unlink. The transfer's data is lost in any case, so the transfer
                    // counts as unlinked.
                    let done = Done {
                        seqnum: target,
                        status: status::UNLINKED,
                        actual: 0,
                        length: submit.length as usize,
                        packets: Vec::new(),
                    };
                    lock(receiver).reply(&done, &mut io::empty())?;
                }
                self.settled.notify_all();
            }
        }
        *answered = None;
        Ok(())
    }
}

fn read_packets(inlet: &mut impl Read, count: u32, len: usize) -> io::Result<Vec<Packet>> {
    let mut packets = Vec::with_capacity(count as usize);
    let mut sum = 0u64;
    for _ in 0..count {
        let mut bytes = [0; PACKET_LEN];
        inlet.read_exact(&mut bytes)?;
        let packet = Packet::decode(&bytes);
        sum += u64::from(packet.actual);
        packets.push(packet);
    }
    if sum != len as u64 {
        return Err(io::Error::other(format!(
            "the server sends {len} bytes in packets of {sum} bytes in all"
        )));
    }
    Ok(packets)
}
