//! Device time, common to all devices of a server.
//!
//! Each device has a [`Seat`]. A device that has nothing left to do states in its seat the time of
//! its next event. It also states a limit that time must not reach before something else has
//! happened, such as the arrival of a frame from the optics. In real time the device is woken when
//! its event is due. With the other clocks, time stands still while any device is busy; once all
//! devices wait, time advances to the earliest event. Stepped time advances no further than
//! requested.

use super::lateness::Lateness;
use super::slowdown::two_digits;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::service::{Clock, ClockPace, Late, Rendering};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, oneshot};

/// Maximum length of a step: one day.
const MAX_STEP_NS: u64 = 86_400_000_000_000;

/// Device time of all devices of a server, in nanoseconds since power-on.
#[derive(Clone)]
pub struct Timeline {
    shared: Arc<Shared>,
}

struct Shared {
    /// Returns how long the devices have been on.
    wall: Box<dyn Fn() -> Duration + Send + Sync>,
    state: Mutex<State>,
}

struct State {
    pace: ClockPace,
    /// Whether the pace must remain real time.
    always_real: bool,
    /// In real time: a device time in nanoseconds, and how long the devices had been on at that
    /// time.
    since: (u64, Duration),
    now_ns: u64,
    /// Device time up to which stepped time advances, in nanoseconds.
    target_ns: u64,
    seats: BTreeMap<u64, Place>,
    next_seat: u64,
    /// Steps in progress.
    steps: Vec<Step>,
    next_step: u64,
    lateness: Lateness,
    rendered: Rendered,
}

/// Frames rendered since power-on.
#[derive(Debug, Clone, Copy, Default)]
struct Rendered {
    frames: u64,
    /// Sum of the intervals at which these frames were exposed.
    exposed: Duration,
    /// Sum of the render times of these frames.
    took: Duration,
}

/// A request that waits for stepped time to reach a target.
struct Step {
    number: u64,
    target_ns: u64,
    done: oneshot::Sender<Stepped>,
}

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stepped {
    /// Everything due by the end of the step has been handled; holds that time in nanoseconds.
    Done(u64),
    /// The step was cancelled at this time in nanoseconds.
    CalledOff(u64),
}

/// A step in progress.
#[derive(Debug)]
pub struct UnderWay {
    /// Number of the step for [`Timeline::give_up`].
    pub number: u64,
    /// Resolves when the step has ended.
    pub ended: oneshot::Receiver<Stepped>,
}

struct Place {
    /// `None` while the device is busy.
    waits: Option<Wait>,
    wake: Arc<Notify>,
}

/// Conditions under which a device with nothing left to do is woken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Wait {
    /// Time of the device's next event, in nanoseconds.
    pub next_ns: Option<u64>,
    /// Time in nanoseconds that the clock must not reach before the device has been busy again.
    pub limit_ns: Option<u64>,
    /// Whether no operation of the device is in progress. While one is, stepped time stands still.
    pub settled: bool,
}

impl Timeline {
    /// Returns a timeline that runs at a pace; `wall` returns how long the devices have been on.
    pub fn new(pace: ClockPace, wall: impl Fn() -> Duration + Send + Sync + 'static) -> Self {
        Self {
            shared: Arc::new(Shared {
                wall: Box::new(wall),
                state: Mutex::new(State {
                    pace,
                    always_real: false,
                    since: (0, Duration::ZERO),
                    now_ns: 0,
                    target_ns: 0,
                    seats: BTreeMap::new(),
                    next_seat: 0,
                    steps: Vec::new(),
                    next_step: 0,
                    lateness: Lateness::default(),
                    rendered: Rendered::default(),
                }),
            }),
        }
    }

    /// Sets the device time at which the timeline begins, 0 by default. The function `wall` passed
    /// to [`Self::new`] must begin at the same value.
    #[must_use]
    pub fn from(self, now_ns: u64) -> Self {
        {
            let mut state = self.shared.state();
            (state.now_ns, state.target_ns) = (now_ns, now_ns);
        }
        self
    }

    /// Returns a seat for a device, which counts as busy until it waits.
    pub fn seat(&self) -> Seat {
        let wake = Arc::new(Notify::new());
        let mut state = self.shared.state();
        let number = state.next_seat;
        state.next_seat += 1;
        let place = Place {
            waits: None,
            wake: wake.clone(),
        };
        state.seats.insert(number, place);
        Seat {
            timeline: self.clone(),
            number,
            wake,
        }
    }

    /// Returns the device time in nanoseconds; it never decreases.
    pub fn now_ns(&self) -> u64 {
        self.shared.now_ns(&self.shared.state())
    }

    /// Returns the pace at which time passes.
    pub fn pace(&self) -> ClockPace {
        self.shared.state().pace
    }

    /// Refuses any pace but real time from now on, for a device whose readers cannot pause it.
    pub fn keep_real(&self) {
        self.shared.state().always_real = true;
    }

    /// Changes the pace from now on, and cancels all steps in progress.
    ///
    /// # Errors
    /// Returns an error if a device needs real time.
    pub fn set_pace(&self, pace: ClockPace) -> Result<()> {
        let mut state = self.shared.state();
        if state.always_real && pace != ClockPace::Real {
            return Err(Error::input(
                "clock.pace",
                format!("{pace:?}").to_lowercase(),
                "real: a device has a V4L2 node, whose reader cannot pause it",
            ));
        }
        let now_ns = self.shared.now_ns(&state);
        state.call_off(now_ns);
        (state.now_ns, state.target_ns) = (now_ns, now_ns);
        state.since = (now_ns, (self.shared.wall)());
        state.pace = pace;
        // All devices wait again, at the new pace.
        for place in state.seats.values_mut() {
            place.waits = None;
            place.wake.notify_one();
        }
        Ok(())
    }

    /// Advances time by `ns`. The result resolves when everything due by then has been handled.
    ///
    /// # Errors
    /// Returns an error if the clock cannot be stepped or the step exceeds one day.
    pub fn step(&self, ns: u64) -> Result<UnderWay> {
        let mut state = self.stepped()?;
        let target_ns = state.target_ns.saturating_add(ns);
        self.go_to(&mut state, target_ns)
    }

    /// Advances time to `ns` in the same way as [`Self::step`].
    ///
    /// # Errors
    /// Returns the errors of [`Self::step`], and an error if `ns` is in the past.
    pub fn run_until(&self, ns: u64) -> Result<UnderWay> {
        let mut state = self.stepped()?;
        self.go_to(&mut state, ns)
    }

    /// Cancels all steps in progress; time stops where it is.
    ///
    /// # Errors
    /// Returns an error if the clock cannot be stepped.
    pub fn stop(&self) -> Result<()> {
        let mut state = self.stepped()?;
        let now_ns = state.now_ns;
        state.target_ns = now_ns;
        state.call_off(now_ns);
        Ok(())
    }

    /// Cancels a step that no client waits for any more. Time then advances no further than the
    /// other clients have requested.
    pub fn give_up(&self, number: u64) {
        let mut state = self.shared.state();
        let count = state.steps.len();
        state.steps.retain(|step| step.number != number);
        if state.steps.len() < count {
            let others = state.steps.iter().map(|step| step.target_ns);
            state.target_ns = others.fold(state.now_ns, u64::max);
        }
    }

    fn stepped(&self) -> Result<MutexGuard<'_, State>> {
        let state = self.shared.state();
        match state.pace {
            ClockPace::Stepped => Ok(state),
            pace => Err(Error::input(
                "clock",
                match pace {
                    ClockPace::Real => "device time follows the wall clock",
                    _ => "device time advances by itself",
                },
                "a stepped clock, as of phasmid serve --clock stepped or after the request {\"clock\":{\"pace\":\"stepped\"}}",
            )),
        }
    }

    fn go_to(&self, state: &mut State, target_ns: u64) -> Result<UnderWay> {
        let from_ns = state.target_ns;
        let to_ns = from_ns.saturating_add(MAX_STEP_NS);
        if !(from_ns..=to_ns).contains(&target_ns) {
            return Err(Error::input(
                "clock",
                format!("to {target_ns} ns"),
                format!("{from_ns} to {to_ns} ns, at most a day at a time"),
            ));
        }
        let (done, ended) = oneshot::channel();
        let number = state.next_step;
        state.next_step += 1;
        state.target_ns = target_ns;
        state.steps.push(Step {
            number,
            target_ns,
            done,
        });
        state.go_on();
        Ok(UnderWay { number, ended })
    }

    /// Returns the time, its pace, the speed of rendering and, in real time, how late events were
    /// handled.
    pub fn about(&self) -> Clock {
        let state = self.shared.state();
        let (lateness, rendered) = (&state.lateness, state.rendered);
        Clock {
            pace: state.pace,
            now_ns: self.shared.now_ns(&state),
            late: (state.pace == ClockPace::Real).then(|| Late {
                events: lateness.events(),
                mean_ns: lateness.mean_ns(),
                percentile_99_ns: lateness.percentile_ns(99),
                max_ns: lateness.max_ns(),
            }),
            rendering: (!rendered.took.is_zero()).then(|| Rendering {
                frames: rendered.frames,
                real_time_factor: two_digits(
                    rendered.exposed.as_secs_f64() / rendered.took.as_secs_f64(),
                ),
            }),
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        // A device that panicked leaves no partial change here.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now_ns(&self, state: &State) -> u64 {
        match state.pace {
            ClockPace::Real => {
                let (from_ns, since) = state.since;
                from_ns.saturating_add(nanoseconds((self.wall)().saturating_sub(since)))
            }
            ClockPace::Fast | ClockPace::Stepped => state.now_ns,
        }
    }
}

impl State {
    /// Cancels all steps in progress.
    fn call_off(&mut self, now_ns: u64) {
        for step in self.steps.drain(..) {
            // Ignore an error: the client may have disconnected.
            let _ = step.done.send(Stepped::CalledOff(now_ns));
        }
    }

    /// Advances time as far as possible once all devices wait.
    fn go_on(&mut self) {
        let stepped = match self.pace {
            // Real time does not depend on the devices.
            ClockPace::Real => return,
            ClockPace::Fast => false,
            ClockPace::Stepped => true,
        };
        let waits: Option<Vec<Wait>> = self.seats.values().map(|place| place.waits).collect();
        let Some(waits) = waits else {
            return;
        };
        if stepped && !waits.iter().all(|wait| wait.settled) {
            return;
        }
        let next = waits.iter().filter_map(|wait| wait.next_ns).min();
        let limit = waits.iter().filter_map(|wait| wait.limit_ns).min();
        let may = |ns: u64| {
            let told = !stepped || ns <= self.target_ns;
            ns <= self.now_ns || told && limit.is_none_or(|limit| ns < limit)
        };
        if let Some(next) = next.filter(|&next| may(next)) {
            self.now_ns = self.now_ns.max(next);
            for place in self.seats.values_mut() {
                let due = |wait: Wait| wait.next_ns.is_some_and(|next| next <= self.now_ns);
                if place.waits.is_some_and(due) {
                    place.waits = None;
                    place.wake.notify_one();
                }
            }
        } else if stepped {
            self.now_ns = self.target_ns;
            for step in self.steps.drain(..) {
                // Ignore an error: the client may have disconnected.
                let _ = step.done.send(Stepped::Done(self.now_ns));
            }
        }
    }
}

/// A device's seat on the [`Timeline`].
pub struct Seat {
    timeline: Timeline,
    number: u64,
    wake: Arc<Notify>,
}

impl Seat {
    /// Returns the device time in nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.timeline.now_ns()
    }

    /// Returns the timeline.
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Reports that an event due at `due_ns` is being handled now.
    pub fn handled(&self, due_ns: u64) {
        if self.timeline.pace() == ClockPace::Real {
            let late_ns = self.now_ns().saturating_sub(due_ns);
            self.timeline.shared.state().lateness.count(late_ns);
        }
    }

    /// Counts a rendered frame, the interval of its exposure and its render time.
    pub fn rendered(&self, interval: Duration, took: Duration) {
        let rendered = &mut self.timeline.shared.state().rendered;
        rendered.frames += 1;
        rendered.exposed += interval;
        rendered.took += took;
    }

    /// Waits, in a tokio runtime, until the device's next event is due or the pace changes. If the
    /// returned future is dropped earlier, the device counts as busy again.
    pub async fn wait(&mut self, wait: Wait) {
        if self.timeline.pace() == ClockPace::Real {
            let left = wait.next_ns.map(|next| next.saturating_sub(self.now_ns()));
            let due = async {
                match left {
                    Some(ns) => tokio::time::sleep(Duration::from_nanos(ns)).await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                () = due => {}
                () = self.wake.notified() => {}
            }
            return;
        }
        // Inputs that have arrived meanwhile must be handled first: yielding lets the event
        // loop poll their sources.
        tokio::task::yield_now().await;
        let waiting = Waiting::new(self, wait);
        while waiting.goes_on() {
            self.wake.notified().await;
        }
    }

    fn set(&self, waits: Option<Wait>) {
        let shared = &self.timeline.shared;
        let mut state = shared.state();
        if let Some(place) = state.seats.get_mut(&self.number) {
            place.waits = waits;
        }
        state.go_on();
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        let shared = &self.timeline.shared;
        let mut state = shared.state();
        state.seats.remove(&self.number);
        state.go_on();
    }
}

/// A seat whose device waits; dropping this value marks the device busy.
struct Waiting<'a>(&'a Seat);

impl<'a> Waiting<'a> {
    fn new(seat: &'a Seat, wait: Wait) -> Self {
        seat.set(Some(wait));
        Self(seat)
    }

    /// Returns whether the device still has to wait for its event.
    fn goes_on(&self) -> bool {
        let state = self.0.timeline.shared.state();
        let place = state.seats.get(&self.0.number);
        // The pace may have changed before this device began to wait.
        state.pace != ClockPace::Real && place.is_some_and(|place| place.waits.is_some())
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.0.set(None);
    }
}

fn nanoseconds(wall: Duration) -> u64 {
    u64::try_from(wall.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
#[path = "timeline_tests.rs"]
mod tests;
