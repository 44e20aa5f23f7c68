//! A host's connection to an in-memory device, without a socket, a thread or a clock: the device is
//! polled when data has arrived for it, and then acts until it has to wait.

use phasmid::Result;
use phasmid::link::usb::UsbDevice;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::future::Future;
use std::io;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::OnceLock;
use std::task::{Context, Poll, Waker};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::runtime::{Builder, Runtime};

/// Maximum number of steps of a device after data has arrived; a device that takes more hangs.
const MAX_STEPS: u32 = 1_000_000;

/// The pipe between device and host.
struct Pipe {
    to_device: VecDeque<u8>,
    closed: bool,
    from_device: Vec<u8>,
    /// Number of bytes that the host accepts before it has processed the bytes received so far.
    room: usize,
    /// Maximum number of bytes that one read returns.
    piece: usize,
    steps: u32,
}

impl Pipe {
    fn step(&mut self) {
        self.steps += 1;
        assert!(self.steps < MAX_STEPS, "the device hangs");
    }
}

#[derive(Clone)]
struct End(Rc<RefCell<Pipe>>);

/// A connection after the import.
pub struct Wire {
    serving: Option<Pin<Box<dyn Future<Output = Result<()>>>>>,
    outcome: Option<Result<()>>,
    pipe: Rc<RefCell<Pipe>>,
    device: UsbDevice,
    now: Rc<Cell<Duration>>,
}

/// Returns the runtime in which the device's sleeps are created. It never ends them: time advances
/// only by [`Wire::advance`].
fn runtime() -> &'static Runtime {
    static RUNTIME: OnceLock<Runtime> = OnceLock::new();
    RUNTIME.get_or_init(|| Builder::new_current_thread().enable_time().build().unwrap())
}

impl Wire {
    /// Imports the device and connects to it.
    pub fn new(device: &UsbDevice) -> Self {
        let pipe = Rc::new(RefCell::new(Pipe {
            to_device: VecDeque::new(),
            closed: false,
            from_device: Vec::new(),
            room: usize::MAX,
            piece: usize::MAX,
            steps: 0,
        }));
        let now = Rc::new(Cell::new(Duration::from_secs(1)));
        let (end, device, time) = (End(pipe.clone()), device.clone(), now.clone());
        let served = device.clone();
        let serving = async move {
            let clock = || {
                end.0.borrow_mut().step();
                time.get()
            };
            served.serve(end.clone(), end.clone(), clock).await
        };
        let mut wire = Self {
            serving: Some(Box::pin(serving)),
            outcome: None,
            pipe,
            device,
            now,
        };
        wire.poll();
        wire
    }

    /// Sends bytes; when this returns, the device has acted on them until it had to wait.
    pub fn send(&mut self, bytes: &[u8]) {
        self.pipe.borrow_mut().to_device.extend(bytes);
        self.poll();
    }

    /// Takes the bytes received from the device since the last call.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.pipe.borrow_mut().from_device)
    }

    /// Sets the number of bytes that the host accepts between two calls of [`Self::take`], and in
    /// one read.
    pub fn set_flow(&mut self, room: usize, piece: usize) {
        {
            let mut pipe = self.pipe.borrow_mut();
            (pipe.room, pipe.piece) = (room, piece);
        }
        self.poll();
    }

    /// Returns the device's time.
    pub fn now(&self) -> Duration {
        self.now.get()
    }

    /// Advances the device's time.
    pub fn advance(&mut self, by: Duration) {
        self.now.set(self.now.get() + by);
        // Sends nothing, but lets the device handle everything that is due.
        self.device.send(&[], self.now.get());
        self.poll();
    }

    /// Lets the device continue after its state has been changed.
    pub fn poll(&mut self) {
        self.pipe.borrow_mut().steps = 0;
        let Some(serving) = &mut self.serving else {
            return;
        };
        let _in_runtime = runtime().enter();
        let mut context = Context::from_waker(Waker::noop());
        if let Poll::Ready(outcome) = serving.as_mut().poll(&mut context) {
            self.outcome = Some(outcome);
            self.serving = None;
        }
    }

    /// Returns whether the device has ended the connection.
    pub fn has_ended(&self) -> bool {
        self.serving.is_none()
    }

    /// Disconnects, and returns the result with which the connection ended for the device.
    pub fn close(mut self) -> Result<()> {
        self.pipe.borrow_mut().closed = true;
        self.set_flow(usize::MAX, usize::MAX);
        self.outcome
            .take()
            .expect("the device ends the connection of a host that has left")
    }
}

impl AsyncRead for End {
    fn poll_read(
        self: Pin<&mut Self>,
        _: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let mut pipe = self.0.borrow_mut();
        pipe.step();
        if pipe.to_device.is_empty() && !pipe.closed {
            return Poll::Pending;
        }
        let len = pipe.piece.min(buffer.remaining()).min(pipe.to_device.len());
        let bytes: Vec<u8> = pipe.to_device.drain(..len).collect();
        buffer.put_slice(&bytes);
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for End {
    fn poll_write(
        self: Pin<&mut Self>,
        _: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let mut pipe = self.0.borrow_mut();
        pipe.step();
        let left = pipe.room.saturating_sub(pipe.from_device.len());
        if left == 0 {
            return Poll::Pending;
        }
        let len = left.min(bytes.len());
        pipe.from_device.extend(&bytes[..len]);
        Poll::Ready(Ok(len))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}
