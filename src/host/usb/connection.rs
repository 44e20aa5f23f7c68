//! Transfers over a connection to an imported device, and the receivers of their replies.
//!
//! A thread reads the replies (`replies`) and hands each reply to the [`Receiver`] that its
//! transfer was submitted with. The thread that submits transfers writes their commands itself, all
//! of them in one write.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::usbip::{Command, HEADER_LEN, MAX_TRANSFER, Packet, Submit};
use std::collections::HashMap;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of transfers in flight; a device that answers none of them gets no more.
const MAX_PENDING: usize = 1024;

/// Locks a mutex, even if another thread panicked while it held the lock.
pub(super) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The completion of a transfer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Done {
    pub(super) seqnum: u32,
    /// See [`status`].
    pub(super) status: i32,
    /// Number of bytes transferred; for a transfer to the host, this many bytes can be read.
    pub(super) actual: usize,
    /// Number of bytes that were requested or sent when the transfer was submitted.
    pub(super) length: usize,
    /// Packets of an isochronous transfer; their data is contiguous.
    pub(super) packets: Vec<Packet>,
}

/// Receives the completions of transfers. It is called by the thread that reads the connection, so
/// it must not block.
pub(super) trait Receiver: Send {
    /// Handles a transfer that has ended or was unlinked. Returns the number of transfers with the
    /// same parameters that are to be submitted next.
    ///
    /// # Errors
    /// Returns the errors of reading `data`; any error ends the connection.
    fn reply(&mut self, done: &Done, data: &mut dyn Read) -> io::Result<usize>;

    /// Called when the connection has ended, and with it every transfer.
    fn gone(&mut self) {}
}

/// A receiver, shared by its transfers.
pub(super) type Shared = Arc<Mutex<dyn Receiver>>;

/// A connection that carries transfers.
pub(super) struct Connection {
    place: String,
    device: u32,
    writer: Mutex<Writer>,
    pub(super) table: Mutex<Table>,
    /// Signalled when an unlink is answered or the connection ends.
    pub(super) settled: Condvar,
    /// Why the connection ended.
    failure: OnceLock<String>,
}

struct Writer {
    stream: TcpStream,
    last: u32,
}

impl Writer {
    fn seqnum(&mut self) -> u32 {
        // Skip 0, which the kernel uses for "none".
        self.last = self.last.wrapping_add(1).max(1);
        self.last
    }
}

/// Transfers and unlinks that wait for a reply.
#[derive(Default)]
pub(super) struct Table {
    pub(super) pending: HashMap<u32, Pending>,
    /// Sequence numbers of unlinks in flight, mapped to their targets.
    pub(super) unlinks: HashMap<u32, u32>,
    pub(super) closed: bool,
}

/// A transfer in flight.
pub(super) struct Pending {
    pub(super) submit: Submit,
    pub(super) receiver: Shared,
}

impl Connection {
    /// Takes over a connection whose import has been granted; `device` is the server's number for
    /// the device.
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

    /// Returns the address, for messages.
    pub(super) fn place(&self) -> &str {
        &self.place
    }

    /// Returns the reason why the connection ended, as an error.
    pub(super) fn error(&self) -> Error {
        let why = self
            .failure
            .get()
            .map_or("the device disconnected", |why| why);
        Error::device(format!("{}: {why}", self.place))
    }

    /// Closes the connection for the reason `why`, which detaches the device. If a reason has been
    /// given before, that reason is kept.
    pub(super) fn close(&self, why: impl Into<String>) {
        // If a reason is already set, it stays.
        let _ = self.failure.set(why.into());
        let _ = lock(&self.writer).stream.shutdown(Shutdown::Both);
    }

    /// Closes the connection like [`Self::close`], but waits up to `deadline` for the server to
    /// hang up too: only then has the server released the device for the next import.
    pub(super) fn leave(&self, why: &str, deadline: Duration) {
        let _ = self.failure.set(why.to_owned());
        let _ = lock(&self.writer).stream.shutdown(Shutdown::Write);
        let table = lock(&self.table);
        let left = self
            .settled
            .wait_timeout_while(table, deadline, |table| !table.closed);
        drop(left);
        self.close(why);
    }

    /// Submits `count` transfers with the parameters of `like`; transfers to the device carry
    /// `data`. Returns the sequence number of the first transfer.
    ///
    /// # Errors
    /// Returns an error if the connection has ended or accepts no more data, or if too many
    /// transfers are unanswered.
    pub(super) fn submit(
        &self,
        like: &Submit,
        data: &[u8],
        count: usize,
        receiver: &Shared,
    ) -> Result<u32> {
        if like.length > MAX_TRANSFER {
            return Err(Error::device(format!(
                "{}: a transfer of {} bytes; expected at most {MAX_TRANSFER}",
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
                    "{}: the device has left {} transfers unanswered",
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
        // Perhaps only part of a command was sent, so no further command can follow.
        self.close(reason(&error));
        Err(self.error())
    }

    /// Unlinks (cancels) the pending transfers that `which` selects by sequence number and
    /// receiver. Their completions reach the receiver as usual.
    ///
    /// # Errors
    /// Returns an error if the connection has ended.
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
            // Newest first, so that the device does not start a transfer that is about to be
            // unlinked.
            targets.sort_unstable_by(|a, b| b.cmp(a));
            for target in targets {
                let seqnum = writer.seqnum();
                table.unlinks.insert(seqnum, target);
                bytes.extend(Command::Unlink { seqnum, target }.encode());
            }
        }
        self.write(writer, &bytes)
    }

    /// Waits until no unlink is in flight; returns whether that happened within the timeout.
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

/// Encodes the packet descriptors of an isochronous transfer to the host, all of equal length.
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

/// Returns the time left until a deadline.
pub(super) fn left(deadline: Instant) -> Duration {
    deadline.saturating_duration_since(Instant::now())
}

/// Describes what a socket error means for the device.
pub(super) fn reason(error: &io::Error) -> String {
    use io::ErrorKind as Kind;
    match error.kind() {
        Kind::UnexpectedEof | Kind::ConnectionReset | Kind::BrokenPipe => {
            "the device disconnected".to_owned()
        }
        Kind::WouldBlock | Kind::TimedOut => "the server accepts no more commands".to_owned(),
        _ => error.to_string(),
    }
}
