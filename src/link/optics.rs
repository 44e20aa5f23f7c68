//! The optics on a thread of their own: rendering takes all cores for milliseconds, and the ports
//! stay responsive meanwhile. Jobs are done in order.

use crate::emulator::{Exposure, Renderer, Shot, Truth};
use crate::pattern::Pattern;
use crate::protocol::Frame;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::mpsc as results;
use tokio::sync::oneshot;

enum Job {
    Expose(Box<Exposure>),
    /// Of a sequence, at a device time or in its middle.
    Truth(Vec<(Pattern, Shot)>, Option<u64>, oneshot::Sender<Truth>),
}

/// Frames that wait to be handed on; the optics stand still beyond that.
const MAX_FRAMES: usize = 64;

/// The thread's handle; dropping it stops the thread after the job in hand.
pub(super) struct Optics {
    jobs: Option<mpsc::Sender<Job>>,
    frames: results::Receiver<Arc<Frame>>,
    /// Exposures handed over whose frames have not come back.
    backlog: usize,
    stop: Arc<AtomicBool>,
    /// Microseconds spent on frames since power-on.
    render_us: Arc<AtomicU64>,
    thread: Option<JoinHandle<()>>,
}

impl Optics {
    /// `wall` tells for how long the device has been on.
    pub(super) fn start(
        mut renderer: Renderer,
        wall: impl Fn() -> Duration + Send + 'static,
    ) -> std::io::Result<Self> {
        let (jobs, queue) = mpsc::channel();
        let (done, frames) = results::channel(MAX_FRAMES);
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let render_us = Arc::new(AtomicU64::new(0));
        let spent = render_us.clone();
        let work = move || {
            for job in queue {
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
                match job {
                    Job::Expose(exposure) => {
                        let start = wall();
                        let frame = renderer.expose(&exposure.shot);
                        let took = wall().saturating_sub(start).as_micros() as u64;
                        spent.fetch_add(took, Ordering::Relaxed);
                        // The other end is gone when the device is switched off.
                        let _ = done.blocking_send(Arc::new(exposure.readout.read(frame)));
                    }
                    Job::Truth(sequence, time_ns, reply) => {
                        let truth = match time_ns {
                            Some(time_ns) => renderer.truth_at(&sequence, time_ns),
                            None => renderer.truth(&sequence),
                        };
                        let _ = reply.send(truth);
                    }
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name("optics".into())
            .spawn(work)?;
        Ok(Self {
            jobs: Some(jobs),
            frames,
            backlog: 0,
            stop,
            render_us,
            thread: Some(thread),
        })
    }

    pub(super) fn backlog(&self) -> usize {
        self.backlog
    }

    pub(super) fn expose(&mut self, exposure: Exposure) {
        self.backlog += 1;
        self.submit(Job::Expose(Box::new(exposure)));
    }

    /// Asks for the truth behind a sequence, at a device time in nanoseconds or in its middle.
    pub(super) fn truth(
        &self,
        sequence: Vec<(Pattern, Shot)>,
        time_ns: Option<u64>,
        reply: oneshot::Sender<Truth>,
    ) {
        self.submit(Job::Truth(sequence, time_ns, reply));
    }

    /// Microseconds spent on frames since power-on.
    pub(super) fn render_us(&self) -> u64 {
        self.render_us.load(Ordering::Relaxed)
    }

    fn submit(&self, job: Job) {
        if let Some(jobs) = &self.jobs {
            // A thread that has died shows as the end of the frames.
            let _ = jobs.send(job);
        }
    }

    /// The next frame; `None` when the thread has died.
    pub(super) async fn next(&mut self) -> Option<Arc<Frame>> {
        let frame = self.frames.recv().await?;
        self.backlog -= 1;
        Some(frame)
    }
}

impl Drop for Optics {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.jobs = None;
        // The thread may stand still for want of room.
        self.frames.close();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
