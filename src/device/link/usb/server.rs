//! The listener from which hosts import devices, as with `usbip attach`.

use super::connection;
use super::device::{Attached, UsbDevice};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::usbip::{BUS_ID_LEN, OPERATION_LEN, Operation, Outcome, text};
use rustix::net::sockopt;
use std::collections::VecDeque;
use std::io::ErrorKind;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::AbortHandle;
use tokio::time::timeout;

/// Maximum number of connections that have not imported a device; beyond it the oldest such
/// connection is closed.
const MAX_OPENING: usize = 64;
/// Timeout for a client's request.
const PATIENCE: Duration = Duration::from_secs(10);

/// Serves devices on a TCP port.
pub struct UsbServer {
    listener: TcpListener,
    devices: Arc<Vec<UsbDevice>>,
}

impl UsbServer {
    /// Listens on an address.
    ///
    /// # Errors
    /// Returns an error if the address is in use or does not belong to this machine.
    pub async fn bind(address: SocketAddr, devices: Vec<UsbDevice>) -> Result<Self> {
        let listener = TcpListener::bind(address)
            .await
            .map_err(|e| match e.kind() {
                ErrorKind::AddrInUse => Error::device(format!(
                    "--usb-listen {address}: something else listens there, perhaps another phasmid \
                     or usbipd; port 0 picks a free one"
                )),
                _ => Error::io(format!("--usb-listen {address}"), e),
            })?;
        Ok(Self {
            listener,
            devices: Arc::new(devices),
        })
    }

    /// Returns the address on which the server listens.
    pub fn address(&self) -> Option<SocketAddr> {
        self.listener.local_addr().ok()
    }

    /// Serves until the returned future is dropped. `clock` returns the time since an arbitrary
    /// fixed point in time.
    pub async fn run(self, clock: impl Fn() -> Duration + Clone + Send + Sync + 'static) {
        let opening = Opening::default();
        for number in 0.. {
            let Ok((stream, _)) = self.listener.accept().await else {
                // The error may be temporary, for example too many open file descriptors.
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            };
            let (devices, clock) = (self.devices.clone(), clock.clone());
            let open = opening.clone();
            // The task is added to the list before it first runs, because there is only one thread.
            let task = tokio::spawn(async move {
                let left = Left(open, number);
                // An error of a client affects its own connection only.
                let _ = serve(stream, &devices, left, clock).await;
            });
            opening.add(number, task.abort_handle());
        }
    }
}

/// Connections that have not imported a device yet.
#[derive(Clone, Default)]
struct Opening(Arc<Mutex<VecDeque<(u64, AbortHandle)>>>);

impl Opening {
    /// Adds a connection. If there are too many, closes the oldest.
    fn add(&self, number: u64, task: AbortHandle) {
        let mut list = self.list();
        if list.len() >= MAX_OPENING
            && let Some((_, oldest)) = list.pop_front()
        {
            oldest.abort();
        }
        list.push_back((number, task));
    }

    fn list(&self) -> MutexGuard<'_, VecDeque<(u64, AbortHandle)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Removes a connection from the list when it has imported a device or has ended.
struct Left(Opening, u64);

impl Drop for Left {
    fn drop(&mut self) {
        self.0.list().retain(|(number, _)| *number != self.1);
    }
}

async fn serve(
    mut stream: TcpStream,
    devices: &[UsbDevice],
    opening: Left,
    clock: impl Fn() -> Duration,
) -> Result<()> {
    let io = |e| Error::io("USB/IP", e);
    stream.set_nodelay(true).map_err(io)?;
    keep_alive(&stream).map_err(io)?;
    let opened = timeout(PATIENCE, open(&mut stream, devices)).await;
    drop(opening);
    let Ok(Some(attached)) =
        opened.map_err(|_| Error::device("USB/IP: the client sent no request in time"))?
    else {
        return Ok(());
    };
    let (reader, writer) = stream.split();
    connection::run(reader, writer, attached.device(), clock).await
}

/// Enables TCP keep-alive, so that the device of a host that has vanished (for example, crashed) is
/// released.
fn keep_alive(stream: &TcpStream) -> std::io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, Duration::from_secs(10))?;
    sockopt::set_tcp_keepintvl(stream, Duration::from_secs(5))?;
    sockopt::set_tcp_keepcnt(stream, 4)?;
    Ok(())
}

/// Handles the first request of a connection. Returns the device if the request imports one.
async fn open(stream: &mut TcpStream, devices: &[UsbDevice]) -> Result<Option<Attached>> {
    let io = |e| Error::io("USB/IP", e);
    let mut operation = [0; OPERATION_LEN];
    stream.read_exact(&mut operation).await.map_err(io)?;
    match Operation::decode(operation)? {
        Operation::List => {
            let mut reply = Operation::List.reply(Outcome::Done).to_vec();
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
            let outcome = match (device, &attached) {
                (None, _) => Outcome::NoDevice,
                (_, None) => Outcome::Busy,
                _ => Outcome::Done,
            };
            let mut reply = Operation::Import.reply(outcome).to_vec();
            if let Some(attached) = &attached {
                reply.extend(attached.device().info().encode());
            }
            stream.write_all(&reply).await.map_err(io)?;
            Ok(attached)
        }
    }
}
