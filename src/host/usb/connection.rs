//! Transfers over a connection to an imported device: who waits for which reply.
//!
//! A thread reads the replies (`replies`) and hands each to the [`Receiver`] that its transfer was submitted
//! with. Commands are written by whoever has one, many of them at once where there are many.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::usbip::{Command, HEADER_LEN, MAX_TRANSFER, Packet, Submit};
use std::collections::HashMap;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Most transfers under way; a device that answers none of them gets no more.
const MAX_PENDING: usize = 1024;

/// Locks, whatever has happened to another thread that held the lock.
pub(super) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The end of a transfer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Done {
    pub(super) seqnum: u32,
    /// See [`status`].
    pub(super) status: i32,
    /// Bytes transferred; those of a transfer to the host can be read.
    pub(super) actual: usize,
    /// Bytes that there was room for.
    pub(super) length: usize,
    /// Packets of an isochronous transfer, their bytes without gaps.
    pub(super) packets: Vec<Packet>,
}

/// What waits for the ends of transfers; called by the thread that reads the connection, which it
/// must not hold up.
pub(super) trait Receiver: Send {
    /// A transfer is over, or was taken back. Gives how many transfers like it to submit again.
    ///
    /// # Errors
    /// Those of reading `data`; with any error the connection is over.
    fn reply(&mut self, done: &Done, data: &mut dyn Read) -> io::Result<usize>;

    /// The connection is over, and so is every transfer.
    fn gone(&mut self) {}
}

/// A receiver as transfers hold it.
pub(super) type Shared = Arc<Mutex<dyn Receiver>>;

/// A connection that carries transfers.
pub(super) struct Connection {
    place: String,
    device: u32,
    writer: Mutex<Writer>,
    pub(super) table: Mutex<Table>,
    /// An unlink was answered, or the connection is over.
    pub(super) settled: Condvar,
    /// Why the connection is over.
    failure: OnceLock<String>,
}

struct Writer {
    stream: TcpStream,
    last: u32,
}

impl Writer {
    fn seqnum(&mut self) -> u32 {
        // 0 is the kernel's own for "none".
        self.last = self.last.wrapping_add(1).max(1);
        self.last
    }
}

/// Who waits for what.
#[derive(Default)]
pub(super) struct Table {
    pub(super) pending: HashMap<u32, Pending>,
    /// Unlinks under way and their targets.
    pub(super) unlinks: HashMap<u32, u32>,
    pub(super) closed: bool,
}

/// A transfer under way.
pub(super) struct Pending {
    pub(super) submit: Submit,
    pub(super) receiver: Shared,
}

impl Connection {
    /// Takes over a connection whose import has been granted; `device` is its number there.
    pub(super) fn new(stream: TcpStream, device: u32, place: &str) -> Self {
        Self {
            place: place.to_owned(),
            device,
            writer: Mutex::new(Writer { stream, last: 0 }),
            table: Mutex::default(),
            settled: Condvar::new(),
            failure: OnceLock::new(),
        }
    }

    /// The address, for messages.
    pub(super) fn place(&self) -> &str {
        &self.place
    }

    /// Why the connection is over.
    pub(super) fn error(&self) -> Error {
        let why = self.failure.get().map_or("the device has gone", |why| why);
        Error::device(format!("{}: {why}", self.place))
    }

    /// Ends the connection, which is how a device is detached; the first reason stays.
    pub(super) fn close(&self, why: impl Into<String>) {
        // Whether it was closed before does not matter.
        let _ = self.failure.set(why.into());
        let _ = lock(&self.writer).stream.shutdown(Shutdown::Both);
    }

    /// Ends the connection as [`Self::close`] does, but waits a while until the server has hung up,
    /// too: only then has it let go of the device, and the next import finds it free.
    pub(super) fn leave(&self, why: &str, patience: Duration) {
        let _ = self.failure.set(why.to_owned());
        let _ = lock(&self.writer).stream.shutdown(Shutdown::Write);
        let table = lock(&self.table);
        let left = self
            .settled
            .wait_timeout_while(table, patience, |table| !table.closed);
        drop(left);
        self.close(why);
    }

    /// Submits `count` transfers like `like`, each with `data` if it goes to the device. Gives the
    /// first one's number.
    ///
    /// # Errors
    /// A connection that is over or takes no more; too many transfers without an answer.
    pub(super) fn submit(
        &self,
        like: &Submit,
        data: &[u8],
        count: usize,
        receiver: &Shared,
    ) -> Result<u32> {
        if like.length > MAX_TRANSFER {
            return Err(Error::device(format!(
                "{}: a transfer of {} bytes, at most {MAX_TRANSFER}",
                self.place, like.length
            )));
        }
        let mut bytes = Vec::with_capacity(count * HEADER_LEN + data.len());
        let mut writer = lock(&self.writer);
        let mut first = None;
        {
            let mut table = lock(&self.table);
            if table.closed {
                return Err(self.error());
            }
            if table.pending.len() + count > MAX_PENDING {
                return Err(Error::device(format!(
                    "{}: the device leaves {} transfers without an answer",
                    self.place,
                    table.pending.len()
                )));
            }
            for _ in 0..count {
                let submit = Submit {
                    seqnum: writer.seqnum(),
                    device: self.device,
                    ..*like
                };
                first.get_or_insert(submit.seqnum);
                bytes.extend(Command::Submit(submit).encode());
                bytes.extend(data);
                bytes.extend(empty_packets(&submit));
                let receiver = Arc::clone(receiver);
                table
                    .pending
                    .insert(submit.seqnum, Pending { submit, receiver });
            }
        }
        self.write(writer, &bytes)?;
        Ok(first.unwrap_or(0))
    }

    fn write(&self, mut writer: MutexGuard<'_, Writer>, bytes: &[u8]) -> Result<()> {
        let Err(error) = writer.stream.write_all(bytes) else {
            return Ok(());
        };
        drop(writer);
        // Part of a command may be on its way: nothing can follow it.
        self.close(super::replies::reason(&error));
        Err(self.error())
    }

    /// Takes back a transfer, or those of a receiver; their ends come to the receiver as always.
    ///
    /// # Errors
    /// A connection that is over.
    pub(super) fn unlink(&self, which: impl Fn(u32, &Shared) -> bool) -> Result<()> {
        let mut bytes = Vec::new();
        let mut writer = lock(&self.writer);
        {
            let mut table = lock(&self.table);
            if table.closed {
                return Err(self.error());
            }
            let mut targets: Vec<u32> = table
                .pending
                .iter()
                .filter(|(seqnum, pending)| which(**seqnum, &pending.receiver))
                .map(|(seqnum, _)| *seqnum)
                .collect();
            // Last come, first gone: none is started that is to be taken back.
            targets.sort_unstable_by(|a, b| b.cmp(a));
            for target in targets {
                let seqnum = writer.seqnum();
                table.unlinks.insert(seqnum, target);
                bytes.extend(Command::Unlink { seqnum, target }.encode());
            }
        }
        self.write(writer, &bytes)
    }

    /// Waits until no unlink is under way; says whether that came in time.
    pub(super) fn settle(&self, timeout: Duration) -> bool {
        let table = lock(&self.table);
        let under_way = |table: &mut Table| !table.unlinks.is_empty() && !table.closed;
        let (table, _) = self
            .settled
            .wait_timeout_while(table, timeout, under_way)
            .unwrap_or_else(PoisonError::into_inner);
        table.unlinks.is_empty()
    }
}

/// Descriptors of the packets of an isochronous transfer to the host, of one length each.
fn empty_packets(submit: &Submit) -> Vec<u8> {
    let count = submit.packets.unwrap_or(0);
    let length = submit.length / count.max(1);
    let packet = |i| Packet {
        offset: i * length,
        length,
        actual: 0,
        status: 0,
    };
    (0..count).flat_map(|i| packet(i).encode()).collect()
}

/// Time left until a deadline.
pub(super) fn left(deadline: Instant) -> Duration {
    deadline.saturating_duration_since(Instant::now())
}
