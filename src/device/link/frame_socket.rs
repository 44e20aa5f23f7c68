//! The camera as a socket: every client receives every frame exposed after it connected, in the
//! format of [`phasmid_protocol::wire`]. A client that is too slow loses frames, which it can detect
//! by the gaps in their ids. A client whose connection fails or that stops reading is dropped. No
//! client can delay the device or another client.
//!
//! The Unix socket and TCP have separate limits on clients and on queued frames: any user of the
//! machine can connect over TCP, and must neither shut the owner out of the Unix socket nor cost the
//! owner a frame. TCP clients may be required to present a token, see
//! [`phasmid_protocol::admission`].

use super::readiness::{stirs, watched};
use crate::FrameSink;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::admission::{self, Token};
use phasmid_protocol::{Frame, wire};
use std::collections::VecDeque;
use std::fs;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;
use tokio::io::unix::AsyncFd;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::{Notify, Semaphore, oneshot};

/// Maximum number of clients of the Unix socket. TCP has a separate limit of the same size.
const MAX_CLIENTS: usize = 32;
/// Maximum number of TCP clients that have not presented their token yet. Beyond it the oldest of
/// these clients is evicted after [`HEARING`]; until then, further connections stay in the kernel's
/// queue.
const MAX_PENDING: usize = 32;
/// Minimum time that a TCP client has to present its token after the challenge. It is long enough
/// for a client on a busy machine, and short enough to work off a full queue of the kernel (128) in
/// 0.4 s.
///
/// This is guaranteed however many clients connect: the kernel's queue is served in order, about
/// [`MAX_PENDING`] connections per `HEARING`, and a client whose token arrives within `HEARING` of
/// the challenge is admitted. Two things are not guaranteed: that a slower client is admitted during
/// a flood, and that a connection gets into a kernel queue that a flood keeps full. The client's
/// system then retries the connection.
const HEARING: Duration = Duration::from_millis(100);
/// Maximum number of TCP connections accepted at a time, so that a flood of connections cannot
/// block the device.
const MAX_ACCEPTED: usize = 64;
/// Maximum number of refused clients of each link (Unix socket, TCP) that are being sent the reason;
/// further refused connections are closed without a reason.
const MAX_REFUSED: usize = MAX_PENDING;
/// Maximum time to read from a refused client. It may have written before it reads, and closing the
/// connection with unread input would reset it and hide the reason from the client.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// Maximum number of frames queued for one client.
const MAX_FRAMES: usize = 1024;
/// Maximum total size in bytes of the frames queued for clients of the Unix socket. A frame queued
/// for several clients counts once. TCP has a separate limit of the same size.
const MAX_BYTES: usize = 256 << 20;
/// A client that reads nothing for this long while frames are queued is disconnected.
const STALL: Duration = Duration::from_secs(30);

/// An encoded frame on its way to clients.
struct Packet {
    header: [u8; wire::HEADER_LEN],
    frame: Arc<Frame>,
    /// Total size in bytes of all packets for clients of the same link, including this packet.
    held: Arc<AtomicUsize>,
}

impl Packet {
    fn new(header: [u8; wire::HEADER_LEN], frame: Arc<Frame>, held: &Arc<AtomicUsize>) -> Self {
        held.fetch_add(frame.data.len(), Ordering::Relaxed);
        Self {
            header,
            frame,
            held: held.clone(),
        }
    }
}

impl Drop for Packet {
    fn drop(&mut self) {
        self.held
            .fetch_sub(self.frame.data.len(), Ordering::Relaxed);
    }
}

/// Packets queued for one client.
#[derive(Default)]
struct Queue {
    packets: Mutex<VecDeque<Arc<Packet>>>,
    put: Notify,
}

impl Queue {
    fn packets(&self) -> MutexGuard<'_, VecDeque<Arc<Packet>>> {
        self.packets.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, packet: Arc<Packet>) {
        let mut packets = self.packets();
        if packets.len() < MAX_FRAMES {
            packets.push_back(packet);
            self.put.notify_one();
        }
    }

    async fn next(&self) -> Arc<Packet> {
        loop {
            if let Some(packet) = self.packets().pop_front() {
                return packet;
            }
            self.put.notified().await;
        }
    }
}

/// Options for serving frames over TCP.
#[derive(Debug, Clone)]
pub struct Tcp {
    /// Port on the loopback interface; 0 picks a free one.
    pub port: u16,
    /// Token that clients must present. If it is `None`, every user of the machine can read the
    /// frames.
    pub token: Option<Token>,
}

/// Link by which a client is connected.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Link {
    Unix,
    Tcp,
}

/// The TCP listener and its clients that are not registered yet.
struct TcpSide {
    listener: TcpListener,
    ready: AsyncFd<OwnedFd>,
    token: Option<Arc<Token>>,
    /// Clients that have not presented the token yet, the oldest first.
    pending: VecDeque<Pending>,
    /// Clients that have presented the token and are not registered yet.
    admitted: Arc<Mutex<Vec<TcpStream>>>,
}

impl TcpSide {
    /// Returns whether another TCP client can be challenged for its token, if necessary by evicting
    /// the oldest pending client. `stirred` is notified whenever this may have become true.
    fn has_place(&mut self) -> bool {
        self.pending.retain(|pending| !pending.place.is_closed());
        self.pending.len() < MAX_PENDING || self.pending[0].heard.load(Ordering::Relaxed)
    }
}

/// A client that has not presented the token yet.
struct Pending {
    task: tokio::task::AbortHandle,
    /// Set when the client has had [`HEARING`] and everything it sent until then has been read.
    heard: Arc<AtomicBool>,
    /// Dropped to evict the client; closed once the client has been admitted or refused.
    place: oneshot::Sender<()>,
}

struct Client {
    link: Link,
    /// Id of the first frame exposed after the client connected.
    first_id: u64,
    /// Dropped with the task that serves the client.
    queue: Weak<Queue>,
    task: tokio::task::AbortHandle,
}

/// The listeners and their clients.
pub(super) struct FrameSocket {
    unix: UnixListener,
    unix_ready: AsyncFd<OwnedFd>,
    tcp: Option<TcpSide>,
    clients: Vec<Client>,
    /// Number of clients that have connected, and number that have disconnected, so far.
    counts: (u64, u64),
    /// Size in bytes of the frames that are queued or being sent, separately for the Unix socket and
    /// TCP. A frame for clients of both links counts in both.
    held: [Arc<AtomicUsize>; 2],
    /// See [`MAX_BYTES`].
    max_bytes: usize,
    /// See [`STALL`].
    stall: Duration,
    /// See [`HEARING`].
    hearing: Duration,
    /// Notified when a client disconnects, is admitted, is refused, or can be evicted.
    stirred: Arc<Notify>,
    /// Limits on the number of clients that are being refused: for the Unix socket and for TCP.
    refusals: [Arc<Semaphore>; 2],
}

impl FrameSocket {
    /// Listens on a path and, if `tcp` is given, on the loopback interface.
    pub(super) fn open(path: &Path, tcp: Option<&Tcp>) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let unix = UnixListener::bind(path).map_err(io)?;
        fs::set_permissions(path, fs::Permissions::from_mode(0o600)).map_err(io)?;
        unix.set_nonblocking(true).map_err(io)?;
        let tcp = match tcp {
            None => None,
            Some(&Tcp { port, ref token }) => {
                let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
                let io = |e| Error::io(format!("--tcp {port}: {address}"), e);
                let listener = TcpListener::bind(address).map_err(io)?;
                listener.set_nonblocking(true).map_err(io)?;
                let ready = duplicate(&listener).and_then(watched).map_err(io)?;
                Some(TcpSide {
                    listener,
                    ready,
                    token: token.clone().map(Arc::new),
                    pending: VecDeque::new(),
                    admitted: Arc::default(),
                })
            }
        };
        Ok(Self {
            unix_ready: duplicate(&unix).and_then(watched).map_err(io)?,
            unix,
            tcp,
            clients: Vec::new(),
            counts: (0, 0),
            held: Default::default(),
            max_bytes: MAX_BYTES,
            stall: STALL,
            hearing: HEARING,
            stirred: Arc::new(Notify::new()),
            refusals: [MAX_REFUSED; 2].map(|limit| Arc::new(Semaphore::new(limit))),
        })
    }

    /// Returns the address on the loopback interface.
    pub(super) fn tcp_address(&self) -> Option<SocketAddr> {
        self.tcp.as_ref()?.listener.local_addr().ok()
    }

    /// Returns how many clients have connected and disconnected, as of the last [`Self::accept`].
    pub(super) fn counts(&self) -> (u64, u64) {
        self.counts
    }

    /// Returns the size in bytes of the frames that clients have not read yet: the larger of the
    /// sizes for the Unix socket and TCP, since their sum would count shared frames twice.
    pub(super) fn waiting(&self) -> usize {
        let [unix, tcp] = &self.held;
        unix.load(Ordering::Relaxed)
            .max(tcp.load(Ordering::Relaxed))
    }

    /// Returns the number of connected clients.
    pub(super) fn readers(&self) -> usize {
        let clients = self.clients.iter();
        clients
            .filter(|client| client.queue.strong_count() > 0)
            .count()
    }

    /// Waits until clients may have connected or disconnected.
    pub(super) async fn changed(&mut self) -> std::io::Result<()> {
        let tcp = async {
            match &self.tcp {
                Some(tcp) => stirs(&tcp.ready).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            () = self.stirred.notified() => Ok(()),
            ready = stirs(&self.unix_ready) => ready,
            ready = tcp => ready,
        }
    }

    /// Accepts new clients and drops disconnected ones. Called before a command is executed, so that
    /// a client that connected before the command was sent receives the frames that the command
    /// causes; `first_id` is the id of the first of these frames.
    pub(super) fn accept(&mut self, first_id: u64) {
        let before = self.clients.len();
        self.clients
            .retain(|client| client.queue.strong_count() > 0);
        self.counts.1 += (before - self.clients.len()) as u64;
        // After any error other than "would block", the client stays in the kernel's queue until
        // the next call.
        while let Ok((stream, _)) = self.unix.accept() {
            if stream.set_nonblocking(true).is_ok()
                && let Ok(stream) = tokio::net::UnixStream::from_std(stream)
            {
                self.add(stream, Link::Unix, first_id, &[]);
            }
        }
        for accepted in 1..=MAX_ACCEPTED {
            let Some(tcp) = &mut self.tcp else { break };
            if !tcp.has_place() {
                break;
            }
            let Ok((stream, _)) = tcp.listener.accept() else {
                break;
            };
            if accepted == MAX_ACCEPTED {
                // Further connections stay in the kernel's queue until the next call.
                self.stirred.notify_one();
            }
            // TCP_NODELAY: a header must not wait for the reader's acknowledgement.
            if stream.set_nonblocking(true).is_ok()
                && stream.set_nodelay(true).is_ok()
                && let Ok(stream) = TcpStream::from_std(stream)
            {
                match tcp.token.clone() {
                    None => self.add(stream, Link::Tcp, first_id, &[]),
                    Some(token) => self.challenge(stream, token),
                }
            }
        }
        let admitted = self.tcp.as_ref().map(|tcp| {
            let mut admitted = tcp.admitted.lock().unwrap_or_else(PoisonError::into_inner);
            std::mem::take(&mut *admitted)
        });
        for stream in admitted.unwrap_or_default() {
            // Sent after the client is registered: from here on it receives every frame.
            let greeting = [&admission::ADMITTED[..], b"\n"].concat();
            self.add(stream, Link::Tcp, first_id, &greeting);
        }
    }

    /// Asks a TCP client for the token. Call only if there is a place for the client, see
    /// [`TcpSide::has_place`].
    fn challenge(&mut self, stream: TcpStream, token: Arc<Token>) {
        let Some(tcp) = &mut self.tcp else { return };
        if tcp.pending.len() >= MAX_PENDING {
            tcp.pending.pop_front();
        }
        let (place, evicted) = oneshot::channel();
        let heard = Arc::new(AtomicBool::new(false));
        let (admitted, stirred) = (tcp.admitted.clone(), self.stirred.clone());
        let refusals = self.refusals[Link::Tcp as usize].clone();
        let (hearing, is_heard) = (self.hearing, heard.clone());
        let task = tokio::spawn(async move {
            let mut stream = stream;
            let challenge = [&admission::TOKEN_REQUIRED[..], b"\n"].concat();
            // If this write fails, `present` fails too.
            let _ = stream.write_all(&challenge).await;
            let evicted = async {
                tokio::time::sleep(hearing).await;
                is_heard.store(true, Ordering::Relaxed);
                stirred.notify_one();
                evicted.await
            };
            let presented = tokio::select! {
                // Read the bytes that have arrived before the client can be evicted.
                biased;
                presented = present(&mut stream, &token) => presented,
                _ = evicted => Err(format!(
                    "no token yet, and {MAX_PENDING} newer connections without one; expected the \
                     token as soon as the connection is open"
                )),
            };
            match presented {
                Ok(()) => admitted
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .push(stream),
                Err(why) => refuse(stream, &refusals, &why),
            }
            stirred.notify_one();
        });
        tcp.pending.push_back(Pending {
            task: task.abort_handle(),
            heard,
            place,
        });
    }

    /// Queues a frame that carries no id.
    pub(super) fn put_counted(&mut self, frame: Arc<Frame>) {
        self.hand_on(wire::encode_counted_header(&frame), frame);
    }

    fn hand_on(&mut self, header: [u8; wire::HEADER_LEN], frame: Arc<Frame>) {
        for link in [Link::Unix, Link::Tcp] {
            self.make_room(link, frame.data.len());
            let held = &self.held[link as usize];
            let packet = Arc::new(Packet::new(header, frame.clone(), held));
            for client in &self.clients {
                if client.link == link
                    && frame.id >= client.first_id
                    && let Some(queue) = client.queue.upgrade()
                {
                    queue.put(packet.clone());
                }
            }
        }
    }

    /// Registers a client, or refuses it if the client's link has too many. `greeting` is sent
    /// before the first frame.
    fn add(
        &mut self,
        stream: impl AsyncRead + AsyncWrite + Send + 'static,
        link: Link,
        first_id: u64,
        greeting: &[u8],
    ) {
        let same = self
            .clients
            .iter()
            .filter(|client| client.link == link && client.queue.strong_count() > 0);
        if same.count() >= MAX_CLIENTS {
            let of = match link {
                Link::Unix => "on the Unix socket",
                Link::Tcp => "over TCP",
            };
            let why = format!("one client too many; expected at most {MAX_CLIENTS} {of}");
            refuse(stream, &self.refusals[link as usize], &why);
            return;
        }
        self.counts.0 += 1;
        let queue = Arc::new(Queue::default());
        let weak = Arc::downgrade(&queue);
        let (stirred, stall) = (self.stirred.clone(), self.stall);
        let greeting = greeting.to_vec();
        let task = tokio::spawn(async move {
            send(stream, &greeting, queue, stall).await;
            stirred.notify_one();
        });
        self.clients.push(Client {
            link,
            first_id,
            queue: weak,
            task: task.abort_handle(),
        });
    }

    /// Disconnects all clients, as when the device disappears; queued frames are lost.
    pub(super) fn hang_up(self) {
        for client in self.clients {
            client.task.abort();
        }
        for pending in self.tcp.into_iter().flat_map(|tcp| tcp.pending) {
            pending.task.abort();
        }
    }

    /// Makes room for `len` more bytes: drops the newest queued frames of the client of this link
    /// that is furthest behind. A frame being sent is kept, so a single frame always fits, however
    /// large it is.
    fn make_room(&self, link: Link, len: usize) {
        let held = &self.held[link as usize];
        let full = || held.load(Ordering::Relaxed) + len > self.max_bytes;
        if !full() {
            return;
        }
        let clients = self.clients.iter().filter(|client| client.link == link);
        let queues: Vec<_> = clients.filter_map(|c| c.queue.upgrade()).collect();
        while full() {
            let waits_for = |queue: &&Arc<Queue>| queue.packets().front().map(|p| p.frame.id);
            let behind = queues.iter().filter(|queue| waits_for(queue).is_some());
            let slowest = behind.min_by_key(waits_for);
            // The memory is freed only if no other client has the frame queued.
            if slowest.and_then(|q| q.packets().pop_back()).is_none() {
                return;
            }
        }
    }
}

impl FrameSink for FrameSocket {
    fn attended(&self) -> bool {
        self.clients
            .iter()
            .any(|client| client.queue.strong_count() > 0)
    }

    fn put(&mut self, frame: Arc<Frame>) {
        self.hand_on(wire::encode_header(&frame), frame);
    }
}

/// Duplicates the descriptor for the event loop; the listener itself can then be polled at any
/// time.
fn duplicate(listener: &impl AsFd) -> std::io::Result<OwnedFd> {
    listener.as_fd().try_clone_to_owned()
}

/// Waits until a client presents its token.
///
/// Returns an error, worded for the client, if the client presents a wrong token or no token in
/// time.
async fn present(stream: &mut TcpStream, token: &Token) -> std::result::Result<(), String> {
    let expected = "expected the line in the file of the device's --tcp-token";
    let line = async {
        let mut line = [0; admission::MAX_TOKEN_BYTES + 2];
        let mut filled = 0;
        while filled < line.len() {
            let read = stream.read(&mut line[filled..]).await?;
            let end = line[filled..filled + read].iter().position(|&b| b == b'\n');
            if let Some(end) = end {
                filled += end;
                break;
            }
            filled += read;
            if read == 0 {
                break;
            }
        }
        std::io::Result::Ok(line[..filled].to_vec())
    };
    match tokio::time::timeout(admission::DEADLINE, line).await {
        Ok(Ok(line)) if token.matches(&line) => Ok(()),
        Ok(Ok(line)) if line.is_empty() => Err(format!("found no token; {expected}")),
        Ok(Ok(_)) => Err(format!("found a wrong token; {expected}")),
        Ok(Err(e)) => Err(e.to_string()),
        Err(_) => Err(format!(
            "found no token within {} s; {expected}",
            admission::DEADLINE.as_secs()
        )),
    }
}

/// Closes a connection after sending the reason, or at once if too many connections are being
/// closed.
fn refuse(
    stream: impl AsyncRead + AsyncWrite + Send + 'static,
    refusals: &Arc<Semaphore>,
    why: &str,
) {
    let Ok(turn) = refusals.clone().try_acquire_owned() else {
        return;
    };
    let line = admission::refusal(&format!("frame stream: {why}"));
    tokio::spawn(async move {
        let last = async {
            let (mut reader, mut writer) = tokio::io::split(stream);
            writer.write_all(&line).await?;
            writer.shutdown().await?;
            tokio::io::copy(&mut reader, &mut tokio::io::sink()).await
        };
        // Best effort: the client may be gone.
        let _ = tokio::time::timeout(LAST_WORDS, last).await;
        drop(turn);
    });
}

/// Sends a greeting and packets until the client disconnects or reads nothing for the time `stall`.
/// Ignores input from clients.
async fn send(
    stream: impl AsyncRead + AsyncWrite,
    greeting: &[u8],
    queue: Arc<Queue>,
    stall: Duration,
) {
    let (mut reader, mut writer) = tokio::io::split(stream);
    if !matches!(
        tokio::time::timeout(stall, writer.write_all(greeting)).await,
        Ok(Ok(()))
    ) {
        return;
    }
    let mut skipped = [0; 4096];
    loop {
        tokio::select! {
            read = reader.read(&mut skipped) => {
                if !matches!(read, Ok(1..)) {
                    return;
                }
            }
            packet = queue.next() => {
                for mut part in [&packet.header[..], &packet.frame.data] {
                    while !part.is_empty() {
                        match tokio::time::timeout(stall, writer.write(part)).await {
                            Ok(Ok(len @ 1..)) => part = &part[len..],
                            _ => return,
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::PixelFormat;
    use std::io::{Read, Write};
    use std::net;
    use std::os::unix::net::UnixStream;
    use tokio::task::{JoinHandle, spawn_blocking};

    /// Size of a frame in bytes, far above the size of the kernel's buffer of a stream.
    const LEN: usize = 4 << 20;
    /// Timeout after which a hanging test fails.
    const LONG: Duration = Duration::from_secs(60);
    const TOKEN: &str = "correct horse battery\n";
    /// Bytes that a client with the right token reads, including the challenge.
    const ADMITTED: &str = "PHTK\nPHOK\n";

    fn frame(id: u64) -> Arc<Frame> {
        Arc::new(Frame {
            id,
            pattern_index: None,
            width: 2048,
            height: 2048,
            format: PixelFormat::Grey,
            exposure_start_ns: 0,
            exposure_end_ns: 1,
            data: vec![id as u8; LEN],
        })
    }

    /// Lets the clients' tasks run.
    async fn pause() {
        tokio::time::sleep(Duration::from_millis(30)).await;
    }

    fn run(test: impl AsyncFnOnce(FrameSocket, &Path)) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("camera.sock");
        let runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = { runtime }.enable_all().build().unwrap();
        runtime.block_on(async {
            let tcp = Tcp {
                port: 0,
                token: None,
            };
            let socket = FrameSocket::open(&path, Some(&tcp)).unwrap();
            test(socket, &path).await;
        });
    }

    /// Runs a test with a device that requires [`TOKEN`] over TCP.
    fn run_with_token(test: impl AsyncFnOnce(FrameSocket)) {
        run(async |mut socket, path| {
            let file = path.with_file_name("token");
            fs::write(&file, TOKEN).unwrap();
            let token = Token::read(&file).unwrap();
            socket.tcp.as_mut().unwrap().token = Some(Arc::new(token));
            test(socket).await;
        });
    }

    fn connect_tcp(socket: &FrameSocket) -> net::TcpStream {
        let stream = net::TcpStream::connect(socket.tcp_address().unwrap()).unwrap();
        stream.set_read_timeout(Some(LONG)).unwrap();
        stream
    }

    /// Connects fewer clients than the kernel's queue holds, but more than the device accepts at a
    /// time or keeps pending.
    fn connect_flood(socket: &FrameSocket) -> Vec<net::TcpStream> {
        (0..3 * MAX_PENDING).map(|_| connect_tcp(socket)).collect()
    }

    /// Reads as many bytes as a client with the right token receives.
    fn read_admission(mut client: impl Read) -> String {
        let mut lines = [0; ADMITTED.len()];
        client.read_exact(&mut lines).unwrap();
        String::from_utf8_lossy(&lines).into_owned()
    }

    /// Serves connections as the device does, until the thread of `client` has ended.
    async fn serve_until<T>(socket: &mut FrameSocket, client: JoinHandle<T>) -> T {
        let served = async {
            loop {
                socket.accept(0);
                socket.changed().await.unwrap();
            }
        };
        tokio::select! {
            () = served => unreachable!("serves forever"),
            result = client => result.unwrap(),
        }
    }

    #[test]
    fn stalled_clients_of_one_kind_cost_the_other_kind_no_frame() {
        for first in [Link::Unix, Link::Tcp] {
            run(async |mut socket, path| {
                socket.max_bytes = 4 * LEN;
                // Nothing is sent, since the clients' tasks do not run.
                let (mut unix, mut tcp) = (None, None);
                for id in 0..6 {
                    if (id == 0) == (first == Link::Unix) && unix.is_none() {
                        unix = Some(UnixStream::connect(path).unwrap());
                    } else if (id == 0) == (first == Link::Tcp) && tcp.is_none() {
                        tcp = Some(connect_tcp(&socket));
                    }
                    socket.accept(id);
                    socket.put(frame(id));
                }
                let queued = socket.clients.iter().map(|client| {
                    let queue = client.queue.upgrade().unwrap();
                    queue.packets().iter().map(|p| p.frame.id).collect()
                });
                let queued: Vec<Vec<u64>> = queued.collect();
                // Each client's queue holds the frames that it would hold if it were the only
                // client.
                assert_eq!(queued, [[0, 1, 2, 5], [1, 2, 3, 5]]);
                assert_eq!(socket.waiting(), 4 * LEN);
            });
        }
    }

    #[test]
    fn token_sent_at_once_is_read_before_a_flood_evicts_its_client() {
        run_with_token(async |mut socket| {
            let mut client = connect_tcp(&socket);
            client.write_all(TOKEN.as_bytes()).unwrap();
            let _flood = connect_flood(&socket);
            let read = spawn_blocking(move || read_admission(client));
            assert_eq!(serve_until(&mut socket, read).await, ADMITTED);
        });
    }

    #[test]
    fn client_that_answers_the_challenge_is_not_evicted_by_a_flood() {
        run_with_token(async |mut socket| {
            // A long `HEARING`, because the client's thread may be slow.
            socket.hearing = LONG;
            let mut client = connect_tcp(&socket);
            let _flood = connect_flood(&socket);
            let read = spawn_blocking(move || {
                // Waits for the challenge.
                client.peek(&mut [0]).unwrap();
                client.write_all(TOKEN.as_bytes()).unwrap();
                read_admission(client)
            });
            assert_eq!(serve_until(&mut socket, read).await, ADMITTED);
        });
    }

    #[test]
    fn client_behind_a_flood_of_silent_ones_is_admitted() {
        run_with_token(async |mut socket| {
            let mut flood = connect_flood(&socket);
            let mut client = connect_tcp(&socket);
            client.write_all(TOKEN.as_bytes()).unwrap();
            let read = spawn_blocking(move || read_admission(client));
            assert_eq!(serve_until(&mut socket, read).await, ADMITTED);
            // The silent clients were evicted long before their deadline.
            let mut oldest = flood.swap_remove(0);
            let read = spawn_blocking(move || {
                let mut all = String::new();
                oldest.read_to_string(&mut all).unwrap();
                all
            });
            let reason = serve_until(&mut socket, read).await;
            assert!(reason.contains("newer connections"), "{reason}");
        });
    }

    #[test]
    fn clients_that_stall_at_different_times_share_one_budget() {
        run(async |mut socket, path| {
            socket.max_bytes = 10 * LEN;
            let mut stuck = Vec::new();
            for id in 0..40 {
                if id % 10 == 0 {
                    stuck.push(UnixStream::connect(path).unwrap());
                    socket.accept(id);
                    pause().await;
                }
                socket.put(frame(id));
                pause().await;
                assert!(socket.waiting() <= 10 * LEN, "{id}");
            }
            // A reader receives a whole burst; clients that do not read lose frames for it.
            let reader = UnixStream::connect(path).unwrap();
            socket.accept(40);
            for id in 40..44 {
                socket.put(frame(id));
            }
            assert!(socket.waiting() <= 10 * LEN);
            let read = tokio::task::spawn_blocking(move || {
                let mut all = vec![0; 4 * (wire::HEADER_LEN + LEN)];
                { reader }.read_exact(&mut all).unwrap();
                all
            });
            let all = read.await.unwrap();
            let last: Vec<u8> = (1..=4)
                .map(|n| all[n * (wire::HEADER_LEN + LEN) - 1])
                .collect();
            assert_eq!(last, [40, 41, 42, 43]);
            drop(stuck);
            pause().await;
            assert_eq!(socket.waiting(), 0);
        });
    }

    #[test]
    fn full_unix_socket_tells_the_next_client_why() {
        run(async |mut socket, path| {
            let _clients: Vec<_> = (0..MAX_CLIENTS)
                .map(|_| UnixStream::connect(path).unwrap())
                .collect();
            let mut refused = UnixStream::connect(path).unwrap();
            socket.accept(0);
            assert_eq!(socket.readers(), MAX_CLIENTS);
            let read = tokio::task::spawn_blocking(move || {
                let mut all = String::new();
                refused.read_to_string(&mut all).unwrap();
                all
            });
            let reason = read.await.unwrap();
            assert!(
                reason.starts_with("PHNO ") && reason.contains("at most 32 on the Unix socket"),
                "{reason}"
            );
        });
    }

    #[test]
    fn client_that_reads_nothing_is_dropped() {
        run(async |mut socket, path| {
            socket.stall = Duration::from_millis(50);
            let _stuck: Vec<_> = (0..MAX_CLIENTS)
                .map(|_| UnixStream::connect(path).unwrap())
                .collect();
            socket.accept(0);
            tokio::time::sleep(4 * socket.stall).await;
            assert!(socket.attended(), "no frames are queued yet");
            socket.put(frame(0));
            tokio::time::sleep(4 * socket.stall).await;
            assert!(!socket.attended());
            socket.accept(1);
            assert!(socket.clients.is_empty());
            assert_eq!(socket.waiting(), 0);
        });
    }
}
