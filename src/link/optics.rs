//! The optics on a thread of their own: rendering takes all cores for milliseconds, and the ports
//! stay responsive meanwhile. Jobs are done in order.

use crate::emulator::{Exposure, Renderer, Truth};
use crate::protocol::Frame;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use tokio::sync::mpsc as results;
use tokio::sync::oneshot;

enum Job {
    Expose(Box<Exposure>),
    Truth(oneshot::Sender<Arc<Truth>>),
}

/// The thread's handle; dropping it stops the thread after the job in hand.
pub(super) struct Optics {
    jobs: Option<mpsc::Sender<Job>>,
    frames: results::UnboundedReceiver<Arc<Frame>>,
    /// Exposures handed over whose frames have not come back.
    backlog: usize,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Optics {
    pub(super) fn start(mut renderer: Renderer) -> std::io::Result<Self> {
        let (jobs, queue) = mpsc::channel();
        let (done, frames) = results::unbounded_channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let work = move || {
            // Computed once: the scene is still.
            let mut truth: Option<Arc<Truth>> = None;
            for job in queue {
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
                match job {
                    Job::Expose(exposure) => {
                        let frame = renderer.expose(&exposure.shot);
                        // The other end is gone when the device is switched off.
                        let _ = done.send(Arc::new(exposure.roi.crop(frame)));
                    }
                    Job::Truth(reply) => {
                        let truth = truth.get_or_insert_with(|| Arc::new(renderer.truth()));
                        let _ = reply.send(truth.clone());
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

    pub(super) fn truth(&mut self, reply: oneshot::Sender<Arc<Truth>>) {
        self.submit(Job::Truth(reply));
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
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
