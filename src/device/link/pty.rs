//! The control port: a pseudo-terminal whose other end a client opens as a serial port.
//!
//! The device keeps a descriptor of the client's side open, so that the port outlives its clients;
//! an inotify watch reports when the last client has closed the port. The device then discards
//! unread output and clears an exclusive lock, as if a cable had been pulled: otherwise the lock of
//! a crashed client would remain. Replies sent while there is no client are lost, as on a physical
//! line.

use super::readiness::{stirs, watched};
use phasmid_core::error::{Error, Result};
use rustix::fs::{Mode, OFlags, inotify};
use rustix::io::Errno;
use rustix::pty::OpenptFlags;
use rustix::termios::{self, OptionalActions, QueueSelector};
use std::ffi::OsString;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::io::unix::AsyncFd;

/// Maximum total size in bytes of the replies queued for a client.
const MAX_OUTPUT: usize = 1 << 20;
/// Maximum number of bytes read at a time; it is small, so that the reply to the first command need
/// not wait for the last one.
const MOST_AT_ONCE: usize = 1 << 10;
/// Interval at which replies are sent again after the kernel's buffer was full.
const RETRY: Duration = Duration::from_millis(5);

/// An event on the port.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Event {
    /// Bytes have arrived.
    Data(Vec<u8>),
    /// The last client has closed the port.
    HungUp,
}

/// The device's end of the pseudo-terminal.
pub(super) struct Pty {
    master: AsyncFd<OwnedFd>,
    slave: OwnedFd,
    path: PathBuf,
    /// Reports clients that open or close the port; `None` if the system does not support it.
    watch: Option<AsyncFd<OwnedFd>>,
    clients: usize,
    /// Whether the last client has closed the port and [`Event::HungUp`] has not been returned yet.
    hung_up: bool,
    /// Whether a write has been reported, so that the system is known to report writes.
    tells_writes: bool,
    /// Whether no write has been reported since a client opened the previously unused port.
    unwritten: bool,
    /// Whether a write has been reported and its bytes may not have been read yet.
    written: bool,
    /// Value of `written` when the last client closed the port.
    left_unread: bool,
    /// Whether the write of the bytes read last has not been reported yet: the system reports a
    /// write only after its bytes can be read.
    owed: bool,
    /// Bytes that have been read and that the next event returns.
    unread: Option<Vec<u8>>,
    output: Vec<u8>,
}

impl Pty {
    /// Creates a port in raw mode, without echo, before any client can open it.
    pub(super) fn open() -> Result<Self> {
        let io = |e: Errno| Error::io("/dev/ptmx", e.into());
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = rustix::pty::openpt(flags).map_err(io)?;
        rustix::pty::grantpt(&master).map_err(io)?;
        rustix::pty::unlockpt(&master).map_err(io)?;
        let name = rustix::pty::ptsname(&master, Vec::new()).map_err(io)?;
        let path = PathBuf::from(OsString::from_vec(name.into_bytes()));
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let slave = rustix::fs::open(&path, flags, Mode::empty()).map_err(io)?;
        let mut attributes = termios::tcgetattr(&slave).map_err(io)?;
        attributes.make_raw();
        termios::tcsetattr(&slave, OptionalActions::Now, &attributes).map_err(io)?;
        let flags = rustix::fs::fcntl_getfl(&master).map_err(io)?;
        rustix::fs::fcntl_setfl(&master, flags | OFlags::NONBLOCK).map_err(io)?;
        let watch = watch(&path).ok();
        Ok(Self {
            master: watched(master).map_err(|e| Error::io("/dev/ptmx", e))?,
            slave,
            path,
            watch,
            clients: 0,
            hung_up: false,
            tells_writes: false,
            unwritten: false,
            written: false,
            left_unread: false,
            owed: false,
            unread: None,
            output: Vec::new(),
        })
    }

    /// Returns the path of the client's side.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Waits for the next event and meanwhile sends queued replies.
    pub(super) async fn next(&mut self) -> Result<Event> {
        loop {
            if let Some(bytes) = self.unread.take() {
                return Ok(Event::Data(bytes));
            }
            match self.read() {
                Ok(bytes) => {
                    self.count_clients();
                    // Bytes that arrived before the last client closed the port belong to that
                    // client and are returned before the hang-up. If a new client has already opened
                    // the port, the hang-up comes first.
                    if self.hung_up && self.clients > 0 {
                        self.hung_up = false;
                        // The writes of the old client are reported before its close, so bytes whose
                        // write has not been reported belong to the new client.
                        let of_old = std::mem::take(&mut self.left_unread);
                        self.unread = match of_old {
                            true => self.skip_old(bytes),
                            false => Some(bytes),
                        };
                        (self.written, self.owed) = (false, !of_old && self.unwritten);
                        return Ok(Event::HungUp);
                    }
                    if bytes.len() < MOST_AT_ONCE {
                        // The kernel has no more bytes buffered.
                        self.owed |= !self.written;
                        (self.written, self.left_unread) = (false, false);
                    }
                    return Ok(Event::Data(bytes));
                }
                // All bytes of reported writes have been read.
                Err(Errno::WOULDBLOCK) => (self.written, self.left_unread) = (false, false),
                Err(e) => return Err(Error::io(&self.path, e.into())),
            }
            self.count_clients();
            // The client may have written and closed after the read.
            if self.hung_up && self.left_unread {
                continue;
            }
            if std::mem::take(&mut self.hung_up) {
                return Ok(Event::HungUp);
            }
            self.write();
            let io = |e| Error::io(&self.path, e);
            // Each branch only clears a readiness that the calls above have used up; the top of the
            // loop repeats these calls.
            tokio::select! {
                ready = watch_stirs(self.watch.as_ref()) => ready.map_err(io)?,
                ready = stirs(&self.master) => ready.map_err(io)?,
                // Linux wakes a pty's writer once, before the buffer has room again, so retry after
                // a delay.
                () = tokio::time::sleep(RETRY), if !self.output.is_empty() => {}
            }
        }
    }

    /// Sends a reply or queues it until the client reads; returns `false` if the queue is full.
    pub(super) fn send(&mut self, reply: &[u8]) -> bool {
        self.count_clients();
        // Until the hang-up has been returned, replies belong to the last client, even if a new
        // client has opened the port.
        if self.watch.is_some() && (self.clients == 0 || self.hung_up) {
            return true;
        }
        self.write();
        if !self.output.is_empty() && self.output.len() + reply.len() > MAX_OUTPUT {
            return false;
        }
        self.output.extend_from_slice(reply);
        self.write();
        true
    }

    /// Discards bytes that the old client wrote and the device did not read, as long as the new
    /// client has written nothing; once it has, the bytes of both cannot be distinguished. Returns
    /// the bytes that may be the new client's.
    fn skip_old(&mut self, mut bytes: Vec<u8>) -> Option<Vec<u8>> {
        loop {
            let more = self.read();
            // A write is reported after its bytes can be read, so check for reports after the read.
            self.count_clients();
            if !(self.tells_writes && self.unwritten) {
                bytes.extend(more.unwrap_or_default());
                return Some(bytes);
            }
            bytes = more.ok()?;
        }
    }

    fn read(&self) -> Result<Vec<u8>, Errno> {
        let mut bytes = vec![0; MOST_AT_ONCE];
        let len = rustix::io::read(&self.master, &mut bytes)?;
        bytes.truncate(len);
        Ok(bytes)
    }

    fn write(&mut self) {
        while !self.output.is_empty() {
            match rustix::io::write(&self.master, &self.output) {
                Ok(len) => drop(self.output.drain(..len)),
                Err(_) => return,
            }
        }
    }

    /// Updates the number of clients. Called after every read and before every reply: if this call
    /// finds that the last client has closed the port, all earlier replies were for that client.
    fn count_clients(&mut self) {
        let Some(watch) = &self.watch else { return };
        let mut buffer = [MaybeUninit::uninit(); 4096];
        let mut reader = inotify::Reader::new(watch.as_fd(), &mut buffer);
        let mut left = false;
        while let Ok(event) = reader.next() {
            if event.events().contains(inotify::ReadFlags::OPEN) {
                self.unwritten |= self.clients == 0;
                self.clients += 1;
            } else if event.events().contains(inotify::ReadFlags::MODIFY) {
                self.tells_writes = true;
                self.unwritten = false;
                self.written |= !std::mem::take(&mut self.owed);
            } else if event
                .events()
                .intersects(inotify::ReadFlags::CLOSE_WRITE | inotify::ReadFlags::CLOSE_NOWRITE)
            {
                self.clients = self.clients.saturating_sub(1);
                if self.clients == 0 {
                    left = true;
                    self.left_unread |= self.written;
                }
            }
        }
        if left {
            self.hung_up = true;
            self.output.clear();
            // The first call discards replies in the kernel's buffer, the second one replies that
            // have reached the client's side. A failure is harmless: a client must expect stale
            // replies on any line.
            let _ = termios::tcflush(&self.master, QueueSelector::OFlush);
            let _ = termios::tcflush(&self.slave, QueueSelector::IFlush);
            if self.clients == 0 {
                let _ = termios::ioctl_tiocnxcl(&self.slave);
            }
        }
    }
}

fn watch(path: &Path) -> Result<AsyncFd<OwnedFd>, std::io::Error> {
    let flags = inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC;
    let watch = inotify::init(flags)?;
    let events = inotify::WatchFlags::OPEN
        | inotify::WatchFlags::MODIFY
        | inotify::WatchFlags::CLOSE_WRITE
        | inotify::WatchFlags::CLOSE_NOWRITE;
    inotify::add_watch(&watch, path, events)?;
    watched(watch)
}

async fn watch_stirs(watch: Option<&AsyncFd<OwnedFd>>) -> std::io::Result<()> {
    match watch {
        Some(watch) => stirs(watch).await,
        None => std::future::pending().await,
    }
}

/// Creates the symbolic link `control` to a pty.
pub(super) fn point(control: &Path, pty: &Pty) -> Result<()> {
    std::os::unix::fs::symlink(pty.path(), control).map_err(|e| Error::io(control, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;
    use std::io::{Read, Write};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    fn client(pty: &Pty) -> File {
        let mut options = File::options();
        options.read(true).write(true).open(pty.path()).unwrap()
    }

    fn run(test: impl AsyncFnOnce(Pty)) {
        let runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = { runtime }.enable_all().build().unwrap();
        runtime.block_on(async { test(Pty::open().unwrap()).await });
    }

    async fn data(pty: &mut Pty) -> Vec<u8> {
        match pty.next().await.unwrap() {
            Event::Data(bytes) => bytes,
            Event::HungUp => panic!("hung up"),
        }
    }

    #[test]
    fn new_client_gets_no_reply_to_the_last_one() {
        run(async |mut pty| {
            let mut old = client(&pty);
            old.write_all(&b"*IDN?\n".repeat(500)).unwrap();
            // The queries of one read are answered; the remaining queries wait.
            assert_eq!(data(&mut pty).await.len(), 1024);
            drop(old);
            let mut new = client(&pty);
            assert!(pty.send(b"to the old one\n"));
            assert_eq!(pty.next().await.unwrap(), Event::HungUp);
            new.write_all(b"*TST?\n").unwrap();
            assert_eq!(data(&mut pty).await, b"*TST?\n");
            assert!(pty.send(b"0\n"));
            let mut reply = [0; 64];
            let len = new.read(&mut reply).unwrap();
            assert_eq!(reply[..len], *b"0\n");
        });
    }

    #[test]
    fn input_of_a_new_client_is_kept_on_hang_up() {
        run(async |mut pty| {
            let mut old = client(&pty);
            old.write_all(&b"*IDN?\n".repeat(200)).unwrap();
            assert_eq!(data(&mut pty).await.len(), 1024);
            drop(old);
            let mut new = client(&pty);
            new.write_all(b"*TST?\n").unwrap();
            assert_eq!(pty.next().await.unwrap(), Event::HungUp);
            assert!(data(&mut pty).await.ends_with(b"*TST?\n"));
        });
    }

    #[test]
    fn input_is_delivered_before_the_hang_up() {
        run(async |mut pty| {
            // The client has been counted, and there is nothing to read.
            let mut old = client(&pty);
            assert!(tokio::time::timeout(RETRY, pty.next()).await.is_err());
            old.write_all(b"*IDN?\n").unwrap();
            drop(old);
            assert_eq!(data(&mut pty).await, b"*IDN?\n");
            assert_eq!(pty.next().await.unwrap(), Event::HungUp);
        });
    }

    /// Keeps threads busy until it is dropped, also when a test fails.
    struct Busy(Arc<AtomicBool>);

    impl Busy {
        fn threads(count: usize) -> Self {
            let over = Arc::new(AtomicBool::new(false));
            for _ in 0..count {
                let over = over.clone();
                std::thread::spawn(move || while !over.load(Ordering::Relaxed) {});
            }
            Self(over)
        }
    }

    impl Drop for Busy {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }

    /// Clients that open the port as soon as the previous client has closed it are all served, even
    /// if other threads preempt a client between its write and the report of that write.
    #[test]
    fn clients_in_quick_succession_are_all_served() {
        const CLIENTS: usize = 3000;
        let busy = Busy::threads(4);
        run(async |mut pty| {
            let path = pty.path().to_owned();
            std::thread::spawn(move || {
                for _ in 0..CLIENTS {
                    let mut options = File::options();
                    let mut port = options.read(true).write(true).open(&path).unwrap();
                    port.write_all(b"*TST?\n").unwrap();
                    let mut reply = [0; 2];
                    port.read_exact(&mut reply).unwrap();
                }
            });
            let (mut heard, mut left) = (0, 0);
            while heard < CLIENTS {
                let next = tokio::time::timeout(Duration::from_secs(20), pty.next()).await;
                match next.expect("a client's bytes did not arrive").unwrap() {
                    Event::Data(bytes) => {
                        assert_eq!(bytes, b"*TST?\n");
                        heard += 1;
                        assert!(pty.send(b"0\n"));
                    }
                    Event::HungUp => left += 1,
                }
            }
            assert_eq!(left, CLIENTS - 1);
        });
        drop(busy);
    }
}
