//! The camera as a socket: every client gets every frame exposed after it connected, in the format
//! of [`crate::protocol::wire`]. A client that is too slow loses frames and sees it by their ids;
//! one that breaks is forgotten; none can hold up the device or another client.

use super::readiness::{stirs, watched};
use crate::emulator::FrameSink;
use crate::error::{Error, Result};
use crate::protocol::{Frame, wire};
use std::fs;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use tokio::io::unix::AsyncFd;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::sync::{Notify, mpsc};

/// Clients at a time; more are turned away.
const MAX_CLIENTS: usize = 32;
/// Frames that wait for one client.
const MAX_FRAMES: usize = 1024;
/// Bytes of frames that wait for one client; the frames are shared among clients.
const MAX_BYTES: usize = 256 << 20;

struct Packet {
    header: [u8; wire::HEADER_LEN],
    frame: Arc<Frame>,
}

struct Client {
    /// Frames exposed before it connected are not its own.
    first_id: u64,
    queue: mpsc::Sender<Arc<Packet>>,
    bytes: Arc<AtomicUsize>,
}

/// The listeners and their clients.
pub(super) struct FrameSocket {
    unix: UnixListener,
    unix_ready: AsyncFd<OwnedFd>,
    tcp: Option<(TcpListener, AsyncFd<OwnedFd>)>,
    clients: Vec<Client>,
    /// Woken when a client leaves.
    left: Arc<Notify>,
}

impl FrameSocket {
    /// Listens on a path and, with a port, on the loopback interface; port 0 picks a free one.
    pub(super) fn open(path: &Path, port: Option<u16>) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let unix = UnixListener::bind(path).map_err(io)?;
        fs::set_permissions(path, fs::Permissions::from_mode(0o600)).map_err(io)?;
        unix.set_nonblocking(true).map_err(io)?;
        let tcp = match port {
            None => None,
            Some(port) => {
                let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
                let io = |e| Error::io(format!("--tcp {port}: {address}"), e);
                let listener = TcpListener::bind(address).map_err(io)?;
                listener.set_nonblocking(true).map_err(io)?;
                let ready = duplicate(&listener).and_then(watched).map_err(io)?;
                Some((listener, ready))
            }
        };
        Ok(Self {
            unix_ready: duplicate(&unix).and_then(watched).map_err(io)?,
            unix,
            tcp,
            clients: Vec::new(),
            left: Arc::new(Notify::new()),
        })
    }

    /// The address on the loopback interface.
    pub(super) fn tcp_address(&self) -> Option<SocketAddr> {
        self.tcp.as_ref()?.0.local_addr().ok()
    }

    /// Waits until clients may have come or gone.
    pub(super) async fn changed(&mut self) -> std::io::Result<()> {
        let tcp = async {
            match &self.tcp {
                Some((_, ready)) => stirs(ready).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            () = self.left.notified() => Ok(()),
            ready = stirs(&self.unix_ready) => ready,
            ready = tcp => ready,
        }
    }

    /// Takes in who has connected, and forgets who has left. Called before a command is executed:
    /// whoever connected before it was sent gets its frames, `first_id` being the first of them.
    pub(super) fn accept(&mut self, first_id: u64) {
        self.clients.retain(|client| !client.queue.is_closed());
        // An error other than "nobody is there" leaves the caller in the queue until the next time.
        while let Ok((stream, _)) = self.unix.accept() {
            if stream.set_nonblocking(true).is_ok()
                && let Ok(stream) = tokio::net::UnixStream::from_std(stream)
            {
                self.add(stream, first_id);
            }
        }
        while let Some((tcp, _)) = &self.tcp
            && let Ok((stream, _)) = tcp.accept()
        {
            // Without delay: a header must not wait for the reader's acknowledgement.
            if stream.set_nonblocking(true).is_ok()
                && stream.set_nodelay(true).is_ok()
                && let Ok(stream) = tokio::net::TcpStream::from_std(stream)
            {
                self.add(stream, first_id);
            }
        }
    }

    fn add(&mut self, stream: impl AsyncRead + AsyncWrite + Send + 'static, first_id: u64) {
        if self.clients.len() >= MAX_CLIENTS {
            return;
        }
        let (queue, packets) = mpsc::channel(MAX_FRAMES);
        let bytes = Arc::new(AtomicUsize::new(0));
        let (left, held) = (self.left.clone(), bytes.clone());
        tokio::spawn(async move {
            send(stream, packets, &held).await;
            left.notify_one();
        });
        self.clients.push(Client {
            first_id,
            queue,
            bytes,
        });
    }
}

impl FrameSink for FrameSocket {
    fn attended(&self) -> bool {
        self.clients.iter().any(|client| !client.queue.is_closed())
    }

    fn put(&mut self, frame: Arc<Frame>) {
        let len = frame.data.len();
        let packet = Arc::new(Packet {
            header: wire::encode_header(&frame),
            frame,
        });
        for client in &self.clients {
            let late = packet.frame.id >= client.first_id;
            // One frame always fits, however large.
            let held = client.bytes.load(Ordering::Relaxed);
            if late
                && (held == 0 || held + len <= MAX_BYTES)
                && client.queue.try_send(packet.clone()).is_ok()
            {
                client.bytes.fetch_add(len, Ordering::Relaxed);
            }
        }
    }
}

/// The event loop has a descriptor of its own: the listener itself is asked at any time.
fn duplicate(listener: &impl AsFd) -> std::io::Result<OwnedFd> {
    listener.as_fd().try_clone_to_owned()
}

/// Sends packets until the client leaves. Clients have nothing to say; what they send is skipped.
async fn send(
    stream: impl AsyncRead + AsyncWrite,
    mut packets: mpsc::Receiver<Arc<Packet>>,
    held: &AtomicUsize,
) {
    let (mut reader, mut writer) = tokio::io::split(stream);
    let mut skipped = [0; 4096];
    loop {
        tokio::select! {
            read = reader.read(&mut skipped) => {
                if !matches!(read, Ok(1..)) {
                    return;
                }
            }
            packet = packets.recv() => {
                let Some(packet) = packet else { return };
                let write = async {
                    writer.write_all(&packet.header).await?;
                    writer.write_all(&packet.frame.data).await
                };
                if write.await.is_err() {
                    return;
                }
                held.fetch_sub(packet.frame.data.len(), Ordering::Relaxed);
            }
        }
    }
}
