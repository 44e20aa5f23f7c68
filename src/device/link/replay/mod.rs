//! A device that behaves as recorded: pty and frame socket as for a served device, with a recording
//! behind them instead of firmware and optics.

mod ahead;
mod departure;
mod ends;
mod player;

pub use player::Outcome;

use super::Notice;
use super::frame_socket::Tcp;
use super::pty::Event;
use super::run_dir::RunDir;
use ends::Ends;
use phasmid_core::error::Result;
use phasmid_protocol::Endpoints;
use phasmid_protocol::record::{About, Reader};
use phasmid_protocol::service::ClockPace;
use player::Player;
use std::future::Future;
use std::io::Read;
use std::path::PathBuf;
use std::pin::pin;
use std::time::Duration;

/// Maximum size in bytes of the frames that wait for readers while recorded delays are skipped.
const MAX_WAITING: usize = 32 << 20;
/// Interval at which to check whether slow readers have caught up.
const RETRY: Duration = Duration::from_millis(1);

/// Options of a replay.
pub struct Replay<R> {
    /// The recording, at its start.
    pub reader: Reader<R>,
    /// Header of the recording.
    pub about: About,
    /// Reading of the system's monotonic clock at time 0 of the replay, in nanoseconds. The times of
    /// frames without an id are relative to it.
    pub monotonic_ns: u64,
    /// Whether to skip the recorded delays.
    pub fast: bool,
    /// Options for serving frames over TCP in addition to the Unix socket.
    pub tcp: Option<Tcp>,
    /// Receives messages for the operator: where a client departs from the recording.
    pub notice: Notice,
}

/// Serves a recording from a run directory, in a tokio runtime, until `shutdown` completes. `wall`
/// returns how long the replay has run; `ready` is called once all ports and sockets are reachable.
///
/// # Errors
/// Returns an error if the system refuses a port or socket.
pub async fn replay<R: Read>(
    replay: Replay<R>,
    mut run_dir: RunDir,
    wall: impl Fn() -> Duration,
    ready: impl FnOnce(&Endpoints),
    shutdown: impl Future<Output = ()>,
) -> Result<Outcome> {
    let mut ends = Ends::open(&mut run_dir, replay.tcp)?;
    let camera_socket = format!("socket:{}", ends.camera_path.display());
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
        slowdown: None,
        control: ends.control.clone(),
        dialect: None,
        baud: None,
        control_usb: None,
        camera: camera_socket.clone(),
        camera_socket,
        camera_tcp: ends.tcp_address.map(|address| format!("tcp:{address}")),
        usb: None,
        service: PathBuf::new(),
    };
    run_dir.publish(&endpoints)?;
    ready(&endpoints);
    let mut player = Player::new(replay.reader, replay.fast, about.monotonic_ns);
    // An action that must wait until clients have read all earlier output.
    let mut held = None;
    let mut shutdown = pin!(shutdown);
    loop {
        let now_ns = nanoseconds(wall());
        if ends.is_watched() {
            player.begin(now_ns);
        }
        let crowded = |ends: &Ends| replay.fast && ends.waiting() > MAX_WAITING;
        if let Some(output) = held.take() {
            held = ends.perform(output, replay.monotonic_ns, now_ns)?;
        }
        while held.is_none()
            && !crowded(&ends)
            && let Some(output) = player.next(now_ns)
        {
            held = ends.perform(output, replay.monotonic_ns, now_ns)?;
        }
        while let Some(news) = player.news() {
            replay.notice.tell(&news);
        }
        let delay = match player.next_event_ns() {
            _ if held.is_some() => Some(RETRY),
            Some(_) if crowded(&ends) => Some(RETRY),
            next => next.map(|next| Duration::from_nanos(next.saturating_sub(now_ns))),
        };
        tokio::select! {
            biased;
            () = &mut shutdown => return Ok(player.finish()),
            event = ends.stirred(player.listens()) => {
                let event = event?;
                // A client that connected before the command was sent receives the frames that it
                // causes.
                ends.accept();
                match event {
                    Some(Event::Data(bytes)) => player.receive(&bytes, nanoseconds(wall())),
                    Some(Event::HungUp) => player.hang_up(nanoseconds(wall())),
                    None => {}
                }
            }
            () = super::server::sleep(delay) => {}
        }
    }
}

fn nanoseconds(wall: Duration) -> u64 {
    u64::try_from(wall.as_nanos()).unwrap_or(u64::MAX)
}
