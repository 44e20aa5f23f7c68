//! The device's ends while a recording is replayed: they go and come back as they did.

use super::ahead::{End, Output};
use crate::FrameSink;
use crate::link::frame_socket::FrameSocket;
use crate::link::pty::{Event, Pty};
use crate::link::run_dir::{CAMERA, CONTROL, RunDir};
use crate::link::server::next_of;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::Frame;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Control port and camera, each `None` while it is gone.
pub(super) struct Ends {
    pty: Option<Pty>,
    camera: Option<FrameSocket>,
    pub(super) control: PathBuf,
    pub(super) camera_path: PathBuf,
    /// The camera's address on the loopback interface.
    pub(super) tcp: Option<SocketAddr>,
}

impl Ends {
    /// Opens both in a run directory, the camera on a port of the loopback interface too if one is
    /// given; 0 picks a free one.
    pub(super) fn open(run_dir: &mut RunDir, tcp: Option<u16>) -> Result<Self> {
        let pty = Pty::open()?;
        let control = run_dir.file(CONTROL);
        point(&control, &pty)?;
        let camera_path = run_dir.file(CAMERA);
        let camera = FrameSocket::open(&camera_path, tcp)?;
        Ok(Self {
            pty: Some(pty),
            control,
            camera_path,
            tcp: camera.tcp_address(),
            camera: Some(camera),
        })
    }

    /// Does what the device did, or hands it back while what was before has to be read.
    /// `monotonic_ns` is the system's clock when the time is 0.
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
                    // None is taken after it has come.
                    let taken_ns = monotonic_ns.saturating_add(taken_ns.min(now_ns));
                    camera.put_counted(Arc::new(Frame {
                        exposure_start_ns: taken_ns,
                        exposure_end_ns: taken_ns,
                        ..Frame::clone(&frame)
                    }));
                }
            }
            // The frames before were read then.
            Output::Gone(End::Camera) if self.waiting() > 0 => return Ok(Some(output)),
            Output::Gone(end) => self.take(end)?,
            Output::Back(end) => self.bring(end)?,
        }
        Ok(None)
    }

    /// Takes an end away, as when a cable is pulled.
    fn take(&mut self, end: End) -> Result<()> {
        let path = match end {
            End::Port => self.pty.take().map(|_| &self.control),
            End::Camera => self.camera.take().map(|camera| {
                camera.hang_up();
                &self.camera_path
            }),
        };
        path.map_or(Ok(()), |path| {
            std::fs::remove_file(path).map_err(|e| Error::io(path, e))
        })
    }

    /// Puts an end back that is gone.
    fn bring(&mut self, end: End) -> Result<()> {
        match end {
            End::Port if self.pty.is_none() => point(&self.control, self.pty.insert(Pty::open()?)),
            End::Camera if self.camera.is_none() => {
                let tcp = self.tcp.map(|address| address.port());
                self.camera = Some(FrameSocket::open(&self.camera_path, tcp)?);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Whether somebody reads the camera.
    pub(super) fn is_watched(&self) -> bool {
        self.camera.as_ref().is_some_and(FrameSink::attended)
    }

    /// Bytes of frames that have not been read yet.
    pub(super) fn waiting(&self) -> usize {
        self.camera.as_ref().map_or(0, FrameSocket::waiting)
    }

    /// Takes in who has connected to the camera.
    pub(super) fn accept(&mut self) {
        if let Some(camera) = &mut self.camera {
            camera.accept(0);
        }
    }

    /// Waits until readers of the camera may have come or gone, or something happens at the port if it
    /// is listened to.
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

/// Names the port.
fn point(control: &Path, pty: &Pty) -> Result<()> {
    std::os::unix::fs::symlink(pty.path(), control).map_err(|e| Error::io(control, e))
}
