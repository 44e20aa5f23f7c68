//! Renders on a separate thread: rendering uses all cores for milliseconds, and the ports must stay
//! responsive. Jobs run in order.

use super::Notice;
use super::shared_scene::Change;
use crate::{Exposure, Renderer, Shot, Truth};
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::Pattern;
use phasmid_protocol::Frame;
use phasmid_protocol::service::Placement;
use phasmid_render::{Decision, Pending, Term};
use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::mpsc as results;
use tokio::sync::oneshot;

enum Job {
    Expose(Box<Exposure>),
    Truth(Box<TruthJob>),
    /// Changes the scene.
    Change(Change, oneshot::Sender<Result<()>>),
    /// Includes or excludes a term if one is given; replies with the plan.
    Plan(Option<(Term, bool)>, oneshot::Sender<Vec<Decision>>),
}

/// A request for ground truth.
pub(super) struct TruthJob {
    /// The sequence whose fringes the truth describes.
    pub(super) sequence: Vec<(Pattern, Shot)>,
    /// Device time in nanoseconds; `None` is the middle of the sequence.
    pub(super) time_ns: Option<u64>,
    /// Poses of the objects at that time, and the poses to restore afterwards.
    pub(super) back: (Vec<Placement>, Vec<Placement>),
    /// Receives the answer.
    pub(super) reply: oneshot::Sender<Result<Truth>>,
}

/// Maximum number of finished frames in the channel; the thread blocks beyond that.
const MAX_FRAMES: usize = 64;

/// A finished frame.
pub(super) struct Rendered {
    /// The finished frame.
    pub(super) frame: Arc<Frame>,
    /// Time that the render thread spent on the frame.
    pub(super) took: Duration,
    /// Interval of the frame's exposure, as passed to [`RenderThread::expose`].
    pub(super) interval: Option<Duration>,
}

/// Handle of the render thread; dropping it stops the thread, even in the middle of a job.
pub(super) struct RenderThread {
    jobs: Option<mpsc::Sender<Job>>,
    /// Finished frames and the time spent on each, followed by the error that ended the thread, if
    /// any.
    frames: results::Receiver<Result<(Arc<Frame>, Duration)>>,
    /// Intervals of the submitted exposures whose frames have not been received, in order.
    backlog: VecDeque<Option<Duration>>,
    stop: Stop,
    /// Time spent on frames since power-on, in microseconds.
    render_us: Arc<AtomicU64>,
    /// Number of frames rendered since power-on.
    rendered: Arc<AtomicU64>,
    thread: Option<JoinHandle<()>>,
}

/// State of the render thread.
struct Work<W> {
    renderer: Renderer,
    /// Frames in progress and the time spent on each so far, in order of exposure.
    under_way: VecDeque<(Box<Exposure>, Pending, Duration)>,
    wall: W,
    spent: Arc<AtomicU64>,
    rendered: Arc<AtomicU64>,
    done: results::Sender<Result<(Arc<Frame>, Duration)>>,
}

impl<W: Fn() -> Duration> Work<W> {
    /// Returns the next job. Finishes frames in progress while there is no job, or if the renderer
    /// is at its limit of concurrent frames. Returns `None` when the handle has been dropped.
    fn next(&mut self, queue: &mpsc::Receiver<Job>, notice: &Notice) -> Option<Job> {
        loop {
            if self.under_way.is_empty() {
                return queue.recv().ok();
            }
            if self.under_way.len() < self.renderer.depth() {
                match queue.try_recv() {
                    Ok(job) => return Some(job),
                    Err(mpsc::TryRecvError::Disconnected) => return None,
                    Err(mpsc::TryRecvError::Empty) => {}
                }
            }
            self.finish();
            if !self.goes_on(notice) {
                return None;
            }
        }
    }

    fn run(&mut self, job: Job) {
        match job {
            Job::Expose(exposure) => {
                let start = (self.wall)();
                let pending = self.renderer.submit(&exposure.shot);
                let took = self.account(start);
                self.under_way.push_back((exposure, pending, took));
            }
            Job::Truth(job) => {
                self.finish_all();
                let (then, now) = &job.back;
                let truth = self.place_all(then).map(|()| match job.time_ns {
                    Some(time_ns) => self.renderer.truth_at(&job.sequence, time_ns),
                    None => self.renderer.truth(&job.sequence),
                });
                let back = self.place_all(now);
                // Ignore an error: the client may have disconnected.
                let _ = job.reply.send(truth.and_then(|truth| back.map(|()| truth)));
            }
            Job::Change(change, reply) => {
                // Frames in progress must show the scene before the change.
                self.finish_all();
                let changed = match change {
                    Change::Moves(moves) => self.place_all(&moves),
                    Change::Scene(scene) => self.renderer.change(*scene),
                };
                // Ignore an error: the client may have disconnected.
                let _ = reply.send(changed);
            }
            Job::Plan(forced, reply) => {
                if let Some((term, included)) = forced {
                    self.finish_all();
                    self.renderer.force(term, included);
                }
                // Ignore an error: the client may have disconnected.
                let _ = reply.send(self.renderer.decisions());
            }
        }
    }

    fn place_all(&mut self, placements: &[Placement]) -> Result<()> {
        placements.iter().try_for_each(|placement| {
            let Placement {
                object,
                position_mm,
                rotation_deg,
            } = *placement;
            let object = object as usize;
            self.renderer.place(object, position_mm, rotation_deg)
        })
    }

    fn finish_all(&mut self) {
        while !self.under_way.is_empty() {
            self.finish();
        }
    }

    /// Finishes the oldest frame in progress and sends it to the handle.
    fn finish(&mut self) {
        if let Some((exposure, pending, took)) = self.under_way.pop_front() {
            let start = (self.wall)();
            let frame = self.renderer.finish(pending);
            let took = took + self.account(start);
            self.rendered.fetch_add(1, Ordering::Relaxed);
            let frame = Arc::new(exposure.readout.read(frame));
            // The receiver is gone when the device is switched off.
            let _ = self.done.blocking_send(Ok((frame, took)));
        }
    }

    /// Adds the time since `start` to the total time spent on frames, and returns the time since
    /// `start`.
    fn account(&self, start: Duration) -> Duration {
        let took = (self.wall)().saturating_sub(start);
        self.spent
            .fetch_add(took.as_micros() as u64, Ordering::Relaxed);
        took
    }

    /// Reports the renderer's messages to the user. Returns `false` if the renderer has failed,
    /// after sending all frames in progress and then the error.
    fn goes_on(&mut self, notice: &Notice) -> bool {
        match self.renderer.news() {
            Ok(news) => {
                if let Some(news) = news {
                    notice.tell(&news);
                }
                true
            }
            Err(e) => {
                self.finish_all();
                let _ = self.done.blocking_send(Err(e));
                false
            }
        }
    }
}

impl RenderThread {
    /// Starts the thread, which renders with `threads` threads, or with rayon's global pool if
    /// `None`. `wall` returns how long the device has been on; `notice` receives messages for the
    /// user.
    pub(super) fn start(
        renderer: Renderer,
        threads: Option<NonZeroUsize>,
        wall: impl Fn() -> Duration + Send + 'static,
        notice: Notice,
    ) -> std::io::Result<Self> {
        let (jobs, queue) = mpsc::channel();
        let (done, frames) = results::channel(MAX_FRAMES);
        let stop = renderer.stop();
        let stopped = stop.clone();
        let render_us = Arc::new(AtomicU64::new(0));
        let rendered = Arc::new(AtomicU64::new(0));
        let mut work = Work {
            renderer,
            under_way: VecDeque::new(),
            wall,
            spent: render_us.clone(),
            rendered: rendered.clone(),
            done,
        };
        let work = move || {
            while let Some(job) = work.next(&queue, &notice) {
                if stopped.is_asked() {
                    return;
                }
                work.run(job);
                if !work.goes_on(&notice) {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("optics".into());
        let thread = match threads {
            None => thread.spawn(work)?,
            Some(threads) => {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.get());
                let pool = pool.build().map_err(std::io::Error::other)?;
                thread.spawn(move || pool.install(work))?
            }
        };
        Ok(Self {
            jobs: Some(jobs),
            frames,
            backlog: VecDeque::new(),
            stop,
            render_us,
            rendered,
            thread: Some(thread),
        })
    }

    pub(super) fn backlog(&self) -> usize {
        self.backlog.len()
    }

    /// Submits an exposure. `interval` is the device time between exposures at the present rate, if
    /// known.
    pub(super) fn expose(&mut self, exposure: Exposure, interval: Option<Duration>) {
        self.backlog.push_back(interval);
        self.submit(Job::Expose(Box::new(exposure)));
    }

    /// Requests ground truth.
    pub(super) fn truth(&self, job: TruthJob) {
        self.submit(Job::Truth(Box::new(job)));
    }

    /// Changes the scene, after the exposures submitted earlier.
    pub(super) fn change(&self, change: Change, reply: oneshot::Sender<Result<()>>) {
        self.submit(Job::Change(change, reply));
    }

    /// Requests the plan, after `forced` (a term and whether it is included) has been applied if
    /// given.
    pub(super) fn plan(&self, forced: Option<(Term, bool)>, reply: oneshot::Sender<Vec<Decision>>) {
        self.submit(Job::Plan(forced, reply));
    }

    /// Returns the number of frames rendered since power-on.
    pub(super) fn rendered(&self) -> u64 {
        self.rendered.load(Ordering::Relaxed)
    }

    /// Returns the time spent on frames since power-on, in microseconds.
    pub(super) fn render_us(&self) -> u64 {
        self.render_us.load(Ordering::Relaxed)
    }

    fn submit(&self, job: Job) {
        if let Some(jobs) = &self.jobs {
            // If the thread has died, the channel of the frames ends and [`Self::next`] reports it.
            let _ = jobs.send(job);
        }
    }

    /// Receives the next finished frame.
    ///
    /// # Errors
    /// Returns an error if the renderer has failed or the thread has died.
    pub(super) async fn next(&mut self) -> Result<Rendered> {
        let died = || Err(Error::device("the render thread panicked"));
        let (frame, took) = self.frames.recv().await.unwrap_or_else(died)?;
        let interval = self.backlog.pop_front().flatten();
        Ok(Rendered {
            frame,
            took,
            interval,
        })
    }
}

impl Drop for RenderThread {
    fn drop(&mut self) {
        self.stop.ask();
        self.jobs = None;
        // The thread may be blocked on a full channel.
        self.frames.close();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
