//! The device's control port and camera during a replay: they disconnect and reconnect as recorded.

use super::ahead::{End, Output};
use crate::FrameSink;
use crate::link::frame_socket::{FrameSocket, Tcp};
use crate::link::pty::{Event, Pty};
use crate::link::run_dir::{CAMERA, CONTROL, RunDir};
use crate::link::server::next_of;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Control port and camera; each is `None` while it is disconnected.
pub(super) struct Ends {
    pty: Option<Pty>,
    camera: Option<FrameSocket>,
    pub(super) control: PathBuf,
    pub(super) camera_path: PathBuf,
    /// Address of the camera on the loopback interface.
    pub(super) tcp_address: Option<SocketAddr>,
    /// Options for serving the camera at this address, with the port that was picked.
    tcp: Option<Tcp>,
}

impl Ends {
    /// Opens both ends in a run directory, and also serves the camera over TCP if `tcp` is given.
    pub(super) fn open(run_dir: &mut RunDir, tcp: Option<Tcp>) -> Result<Self> {
        let pty = Pty::open()?;
        let control = run_dir.file(CONTROL);
        point(&control, &pty)?;
        let camera_path = run_dir.file(CAMERA);
        let camera = FrameSocket::open(&camera_path, tcp.as_ref())?;
        Ok(Self {
            pty: Some(pty),
            control,
            camera_path,
            tcp_address: camera.tcp_address(),
            tcp: tcp.map(|tcp| Tcp {
                port: camera.tcp_address().map_or(tcp.port, |at| at.port()),
                ..tcp
            }),
            camera: Some(camera),
        })
    }

    /// Performs an action, or returns the action if clients must read earlier output first.
    /// `monotonic_ns` is the reading of the system's clock at time 0 of the replay.
    pub(super) fn perform(
        &mut self,
        output: Output,
        monotonic_ns: u64,
        now_ns: u64,
    ) -> Result<Option<Output>> {
        match output {
            Output::Bytes(bytes) => {
                let sent = self.pty.as_mut().is_none_or(|pty| pty.send(&bytes));
                return Ok((!sent).then_some(Output::Bytes(bytes)));
            }
            Output::Frame(frame) => {
                if let Some(camera) = &mut self.camera {
                    camera.put(frame);
                }
            }
            Output::Counted(frame, taken_ns) => {
                if let Some(camera) = &mut self.camera {
                    // A frame cannot have been taken later than it arrived.
                    let taken_ns = monotonic_ns.saturating_add(taken_ns.min(now_ns));
                    camera.put_counted(Arc::new(Frame {
                        exposure_start_ns: taken_ns,
                        exposure_end_ns: taken_ns,
                        ..Frame::clone(&frame)
                    }));
                }
            }
            // The recorded client had read the earlier frames at this point.
            Output::Gone(End::Camera) if self.waiting() > 0 => return Ok(Some(output)),
            Output::Gone(end) => self.take(end)?,
            Output::Back(end) => self.bring(end)?,
        }
        Ok(None)
    }

    /// Disconnects an end, as when a cable is pulled. Its path is removed before the end is closed,
    /// because a new port of another device may get the same number, and the path must not lead to
    /// that port.
    fn take(&mut self, end: End) -> Result<()> {
        let (is_there, path) = match end {
            End::Port => (self.pty.is_some(), &self.control),
            End::Camera => (self.camera.is_some(), &self.camera_path),
        };
        if !is_there {
            return Ok(());
        }
        std::fs::remove_file(path).map_err(|e| Error::io(path, e))?;
        match end {
            End::Port => self.pty = None,
            End::Camera => {
                if let Some(camera) = self.camera.take() {
                    camera.hang_up();
                }
            }
        }
        Ok(())
    }

    /// Reconnects a disconnected end.
    fn bring(&mut self, end: End) -> Result<()> {
        match end {
            End::Port if self.pty.is_none() => point(&self.control, self.pty.insert(Pty::open()?)),
            End::Camera if self.camera.is_none() => {
                let camera = FrameSocket::open(&self.camera_path, self.tcp.as_ref())?;
                self.camera = Some(camera);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Returns whether a client reads the camera.
    pub(super) fn is_watched(&self) -> bool {
        self.camera.as_ref().is_some_and(FrameSink::attended)
    }

    /// Returns the size in bytes of the frames not read yet.
    pub(super) fn waiting(&self) -> usize {
        self.camera.as_ref().map_or(0, FrameSocket::waiting)
    }

    /// Accepts new clients of the camera.
    pub(super) fn accept(&mut self) {
        if let Some(camera) = &mut self.camera {
            camera.accept(0);
        }
    }

    /// Waits until clients of the camera may have connected or disconnected, or, if the port is
    /// being read, for an event on it.
    pub(super) async fn stirred(&mut self, listens: bool) -> Result<Option<Event>> {
        let camera = async {
            match &mut self.camera {
                Some(camera) => camera.changed().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            changed = camera => changed.map(|()| None).map_err(|e| Error::io(CAMERA, e)),
            event = next_of(self.pty.as_mut()), if listens => event.map(Some),
        }
    }
}

/// Creates the symbolic link `control` to the port.
fn point(control: &Path, pty: &Pty) -> Result<()> {
    std::os::unix::fs::symlink(pty.path(), control).map_err(|e| Error::io(control, e))
}
