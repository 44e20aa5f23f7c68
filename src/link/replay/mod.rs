//! A device that behaves as recorded: pty and frame socket, like those of a device that is served,
//! with a recording behind them in place of firmware and optics.

mod ahead;
mod departure;
mod player;

pub use player::Outcome;

use super::frame_socket::FrameSocket;
use super::pty::{Event, Pty};
use super::run_dir::{CAMERA, CONTROL, RunDir};
use crate::emulator::FrameSink;
use crate::error::{Error, Result};
use crate::protocol::record::{About, Reader};
use crate::protocol::service::ClockPace;
use crate::protocol::{Endpoints, Frame};
use ahead::Output;
use player::Player;
use std::future::Future;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

/// Bytes of frames that may wait for readers while no delays hold the next ones back.
const MAX_WAITING: usize = 32 << 20;
/// How often readers that are behind are looked at.
const RETRY: Duration = Duration::from_millis(1);

/// What is replayed.
pub struct Replay<R> {
    /// The recording, at its beginning.
    pub reader: Reader<R>,
    /// What it says of itself.
    pub about: About,
    /// The system's monotonic clock when the time is 0, in nanoseconds: the times of frames that do
    /// not say which they are count by it.
    pub monotonic_ns: u64,
    /// Without the recorded delays.
    pub fast: bool,
    /// Port on the loopback interface for frames; 0 picks a free one.
    pub tcp: Option<u16>,
    /// Takes what whoever looks after the replay should know: where a client leaves the path.
    pub notice: fn(&str),
}

/// Serves a recording from a run directory until `shutdown` is done, in a tokio runtime. `wall`
/// tells for how long; `ready` is called once everything can be reached.
///
/// # Errors
/// Ports and sockets that the system refuses.
pub async fn replay<R: Read>(
    replay: Replay<R>,
    mut run_dir: RunDir,
    wall: impl Fn() -> Duration,
    ready: impl FnOnce(&Endpoints),
    shutdown: impl Future<Output = ()>,
) -> Result<Outcome> {
    // `None` while the port is gone, as when a cable is pulled.
    let mut pty = Some(Pty::open()?);
    let control = run_dir.file(CONTROL);
    point(&control, pty.as_ref())?;
    let camera_path = run_dir.file(CAMERA);
    let mut camera = FrameSocket::open(&camera_path, replay.tcp)?;
    let camera_socket = format!("socket:{}", camera_path.display());
    let about = replay.about;
    let endpoints = Endpoints {
        name: about.name,
        pid: std::process::id(),
        profile: about.profile,
        scene: about.scene,
        seed: about.seed,
        clock: Some(match replay.fast {
            true => ClockPace::Fast,
            false => ClockPace::Real,
        }),
        control: control.clone(),
        dialect: None,
        baud: None,
        control_usb: None,
        camera: camera_socket.clone(),
        camera_socket,
        camera_tcp: camera.tcp_address().map(|address| format!("tcp:{address}")),
        usb: None,
        service: PathBuf::new(),
    };
    run_dir.publish(&endpoints)?;
    ready(&endpoints);
    let mut player = Player::new(replay.reader, replay.fast, about.monotonic_ns);
    // A reply for which the port has no room yet.
    let mut held = None;
    let mut shutdown = pin!(shutdown);
    loop {
        let now_ns = nanoseconds(wall());
        if camera.attended() {
            player.begin(now_ns);
        }
        let crowded = |camera: &FrameSocket| replay.fast && camera.waiting() > MAX_WAITING;
        while held.is_none()
            && !crowded(&camera)
            && let Some(output) = player.next(now_ns)
        {
            match output {
                Output::Bytes(bytes) if !send(&mut pty, &bytes) => held = Some(bytes),
                Output::Bytes(_) => {}
                Output::Unplug(true) if pty.is_none() => {}
                Output::Unplug(true) => {
                    pty = None;
                    point(&control, None)?;
                }
                Output::Unplug(false) if pty.is_some() => {}
                Output::Unplug(false) => {
                    pty = Some(Pty::open()?);
                    point(&control, pty.as_ref())?;
                }
                Output::Frame(frame) => camera.put(frame),
                Output::Counted(frame, taken_ns) => {
                    // None is taken after it has come.
                    let taken_ns = replay.monotonic_ns.saturating_add(taken_ns.min(now_ns));
                    camera.put_counted(Arc::new(Frame {
                        exposure_start_ns: taken_ns,
                        exposure_end_ns: taken_ns,
                        ..Frame::clone(&frame)
                    }));
                }
            }
        }
        if held.take_if(|bytes| send(&mut pty, bytes)).is_some() {
            continue;
        }
        while let Some(news) = player.news() {
            (replay.notice)(&news);
        }
        let delay = match player.next_event_ns() {
            _ if held.is_some() => Some(RETRY),
            Some(_) if crowded(&camera) => Some(RETRY),
            next => next.map(|next| Duration::from_nanos(next.saturating_sub(now_ns))),
        };
        tokio::select! {
            biased;
            () = &mut shutdown => return Ok(player.finish()),
            changed = camera.changed() => {
                changed.map_err(|e| Error::io(CAMERA, e))?;
                camera.accept(0);
            }
            event = super::server::next_of(pty.as_mut()), if player.listens() => {
                // Who connected before the command was sent gets the frames that it causes.
                camera.accept(0);
                match event? {
                    Event::Data(bytes) => player.receive(&bytes, nanoseconds(wall())),
                    Event::HungUp => player.hang_up(nanoseconds(wall())),
                }
            }
            () = super::server::sleep(delay) => {}
        }
    }
}

/// Hands bytes to the port, if there is one; false when it has no room for them.
fn send(pty: &mut Option<Pty>, bytes: &[u8]) -> bool {
    pty.as_mut().is_none_or(|pty| pty.send(bytes))
}

/// Names the port, or takes its name away.
fn point(control: &Path, pty: Option<&Pty>) -> Result<()> {
    match pty {
        Some(pty) => std::os::unix::fs::symlink(pty.path(), control),
        None => std::fs::remove_file(control),
    }
    .map_err(|e| Error::io(control, e))
}

fn nanoseconds(wall: Duration) -> u64 {
    u64::try_from(wall.as_nanos()).unwrap_or(u64::MAX)
}
