//! The listener that hosts import devices from, as `usbip attach` does.

use super::attached::Attached;
use super::connection;
use super::session::UsbDevice;
use crate::error::{Error, Result};
use crate::protocol::usb::usbip::{BUS_ID_LEN, OPERATION_LEN, Operation, text};
use rustix::net::sockopt;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;

/// Connections at a time; more are turned away.
const MAX_CONNECTIONS: usize = 64;
/// A client that does not say in this time what it wants is turned away.
const PATIENCE: Duration = Duration::from_secs(10);

/// Devices on a TCP port.
pub struct UsbServer {
    listener: TcpListener,
    devices: Arc<Vec<UsbDevice>>,
}

impl UsbServer {
    /// Listens.
    ///
    /// # Errors
    /// An address that is taken or not this machine's.
    pub async fn bind(address: SocketAddr, devices: Vec<UsbDevice>) -> Result<Self> {
        let listener = TcpListener::bind(address)
            .await
            .map_err(|e| Error::io(format!("--usb-listen {address}"), e))?;
        Ok(Self {
            listener,
            devices: Arc::new(devices),
        })
    }

    /// Where it listens.
    pub fn address(&self) -> Option<SocketAddr> {
        self.listener.local_addr().ok()
    }

    /// Serves until it is dropped. `clock` tells the time since any moment.
    pub async fn run(self, clock: impl Fn() -> Duration + Clone + Send + Sync + 'static) {
        let connections = Arc::new(AtomicUsize::new(0));
        loop {
            let Ok((stream, _)) = self.listener.accept().await else {
                // Out of descriptors, for one: it may pass.
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            };
            if connections.load(Ordering::Relaxed) >= MAX_CONNECTIONS {
                continue;
            }
            let guard = Guard::new(&connections);
            let (devices, clock) = (self.devices.clone(), clock.clone());
            tokio::spawn(async move {
                // A client that breaks or sends nonsense harms its own connection only.
                let _ = serve(stream, &devices, clock).await;
                drop(guard);
            });
        }
    }
}

/// Counts a connection while it lives.
struct Guard(Arc<AtomicUsize>);

impl Guard {
    fn new(count: &Arc<AtomicUsize>) -> Self {
        count.fetch_add(1, Ordering::Relaxed);
        Self(count.clone())
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

async fn serve(
    mut stream: TcpStream,
    devices: &[UsbDevice],
    clock: impl Fn() -> Duration,
) -> Result<()> {
    let io = |e| Error::io("USB/IP", e);
    stream.set_nodelay(true).map_err(io)?;
    keep_alive(&stream).map_err(io)?;
    let opening = timeout(PATIENCE, open(&mut stream, devices)).await;
    let Ok(Some(attached)) = opening.map_err(|_| Error::device("USB/IP: a silent client"))? else {
        return Ok(());
    };
    let (reader, writer) = stream.split();
    connection::run(reader, writer, attached.device(), clock).await
}

/// A host that has gone without a word, its machine for one, does not keep a device for ever.
fn keep_alive(stream: &TcpStream) -> std::io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, Duration::from_secs(10))?;
    sockopt::set_tcp_keepintvl(stream, Duration::from_secs(5))?;
    sockopt::set_tcp_keepcnt(stream, 4)?;
    Ok(())
}

/// What a connection begins with; the device that it has imported.
async fn open(stream: &mut TcpStream, devices: &[UsbDevice]) -> Result<Option<Attached>> {
    let io = |e| Error::io("USB/IP", e);
    let mut operation = [0; OPERATION_LEN];
    stream.read_exact(&mut operation).await.map_err(io)?;
    match Operation::decode(operation)? {
        Operation::List => {
            let mut reply = Operation::List.reply(true).to_vec();
            reply.extend((devices.len() as u32).to_be_bytes());
            for device in devices {
                reply.extend(device.info().encode());
                reply.extend(device.interface_classes());
            }
            stream.write_all(&reply).await.map_err(io)?;
            Ok(None)
        }
        Operation::Import => {
            let mut bus_id = [0; BUS_ID_LEN];
            stream.read_exact(&mut bus_id).await.map_err(io)?;
            let bus_id = text(&bus_id);
            let device = devices.iter().find(|device| device.info().bus_id == bus_id);
            let attached = device.and_then(|device| Attached::take(device).ok());
            let mut reply = Operation::Import.reply(attached.is_some()).to_vec();
            if let Some(attached) = &attached {
                reply.extend(attached.device().info().encode());
            }
            stream.write_all(&reply).await.map_err(io)?;
            Ok(attached)
        }
    }
}
