//! Device time, one for all devices of a server.
//!
//! Each device has a [`Seat`]. It says there, when it has nothing left to do, what it waits for:
//! the time of its next event, and a time that may not be reached before something else has
//! happened, such as a frame that the optics owe it. On the wall's time it is woken then. Otherwise
//! time stands still while any device is at work, and once none is, goes to the earliest event of
//! them all; where time is stepped from outside, no further than it was told to.

use super::lateness::Lateness;
use phasmid_protocol::service::{Clock, ClockPace, Late};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, oneshot};

/// Longest step at a time: a day.
const MAX_STEP_NS: u64 = 86_400_000_000_000;

/// Device time of all devices of a server, in nanoseconds from power-on.
#[derive(Clone)]
pub struct Timeline {
    shared: Arc<Shared>,
}

struct Shared {
    pace: ClockPace,
    /// For how long the devices have been on.
    wall: Box<dyn Fn() -> Duration + Send + Sync>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    now_ns: u64,
    /// Where stepped time is to get to.
    target_ns: u64,
    seats: BTreeMap<u64, Place>,
    next_seat: u64,
    /// Steps under way.
    steps: Vec<Step>,
    next_step: u64,
    lateness: Lateness,
}

/// Somebody who waits for stepped time to get somewhere.
struct Step {
    number: u64,
    target_ns: u64,
    done: oneshot::Sender<Stepped>,
}

/// How a step has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stepped {
    /// All that was due by then has been handled; the time in nanoseconds.
    Done(u64),
    /// It was called off at this time in nanoseconds.
    CalledOff(u64),
}

/// A step under way.
#[derive(Debug)]
pub struct UnderWay {
    /// By which it can be given up.
    pub number: u64,
    /// Tells how it has ended.
    pub ended: oneshot::Receiver<Stepped>,
}

struct Place {
    /// `None` while the device is at work.
    waits: Option<Wait>,
    wake: Arc<Notify>,
}

/// What a device that has nothing left to do waits for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Wait {
    /// Its next event.
    pub next_ns: Option<u64>,
    /// Time may not come to here before it has something else to do.
    pub limit_ns: Option<u64>,
    /// Nothing that it has begun is still under way: stepped time does not go on before.
    pub settled: bool,
}

impl Timeline {
    /// Time that passes at a pace; `wall` tells for how long the devices have been on.
    pub fn new(pace: ClockPace, wall: impl Fn() -> Duration + Send + Sync + 'static) -> Self {
        Self {
            shared: Arc::new(Shared {
                pace,
                wall: Box::new(wall),
                state: Mutex::default(),
            }),
        }
    }

    /// A place for a device, which is at work until it says otherwise.
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

    /// Device time now, in nanoseconds; never goes back.
    pub fn now_ns(&self) -> u64 {
        match self.shared.pace {
            ClockPace::Real => nanoseconds((self.shared.wall)()),
            ClockPace::Fast | ClockPace::Stepped => self.shared.state().now_ns,
        }
    }

    /// Lets time pass for so long. What comes back tells when all that was due by then has been
    /// handled.
    ///
    /// # Errors
    /// A clock that nobody may step, and steps of more than a day.
    pub fn step(&self, ns: u64) -> Result<UnderWay, String> {
        let mut state = self.stepped()?;
        let target_ns = state.target_ns.saturating_add(ns);
        self.go_to(&mut state, target_ns)
    }

    /// Lets time pass until then, as [`Self::step`] does.
    ///
    /// # Errors
    /// Those of [`Self::step`], and a time that has passed.
    pub fn run_until(&self, ns: u64) -> Result<UnderWay, String> {
        let mut state = self.stepped()?;
        self.go_to(&mut state, ns)
    }

    /// Calls off all steps under way: time stands still where it is.
    ///
    /// # Errors
    /// A clock that nobody may step.
    pub fn stop(&self) -> Result<(), String> {
        let mut state = self.stepped()?;
        state.target_ns = state.now_ns;
        let now_ns = state.now_ns;
        for step in state.steps.drain(..) {
            // Who asked may have left meanwhile.
            let _ = step.done.send(Stepped::CalledOff(now_ns));
        }
        Ok(())
    }

    /// Takes back a step that nobody waits for any more: time goes no further than others have
    /// asked for.
    pub fn give_up(&self, number: u64) {
        let mut state = self.shared.state();
        let count = state.steps.len();
        state.steps.retain(|step| step.number != number);
        if state.steps.len() < count {
            let others = state.steps.iter().map(|step| step.target_ns);
            state.target_ns = others.fold(state.now_ns, u64::max);
        }
    }

    fn stepped(&self) -> Result<MutexGuard<'_, State>, String> {
        match self.shared.pace {
            ClockPace::Stepped => Ok(self.shared.state()),
            pace => Err(format!(
                "clock: {}; allowed: to step the clock of phasmid serve --clock stepped",
                match pace {
                    ClockPace::Real => "device time is the wall's",
                    _ => "device time goes on by itself",
                }
            )),
        }
    }

    fn go_to(&self, state: &mut State, target_ns: u64) -> Result<UnderWay, String> {
        let from_ns = state.target_ns;
        let to_ns = from_ns.saturating_add(MAX_STEP_NS);
        if !(from_ns..=to_ns).contains(&target_ns) {
            return Err(format!(
                "clock: to {target_ns} ns; allowed: {from_ns} to {to_ns} ns, a day at a time"
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
        state.go_on(self.shared.pace);
        Ok(UnderWay { number, ended })
    }

    /// The time, how it passes, and on the wall's time how late events were handled.
    pub fn about(&self) -> Clock {
        let now_ns = self.now_ns();
        let state = self.shared.state();
        let lateness = &state.lateness;
        Clock {
            pace: self.shared.pace,
            now_ns,
            late: (self.shared.pace == ClockPace::Real).then(|| Late {
                events: lateness.events(),
                mean_ns: lateness.mean_ns(),
                percentile_99_ns: lateness.percentile_ns(99),
                max_ns: lateness.max_ns(),
            }),
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        // A device that has died leaves nothing half done here.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Time goes as far as it may, once all devices wait.
    fn go_on(&mut self, pace: ClockPace) {
        let stepped = match pace {
            // It does not ask.
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
                // Who asked may have left meanwhile.
                let _ = step.done.send(Stepped::Done(self.now_ns));
            }
        }
    }
}

/// A device's place on the [`Timeline`].
pub struct Seat {
    timeline: Timeline,
    number: u64,
    wake: Arc<Notify>,
}

impl Seat {
    /// Device time now, in nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.timeline.now_ns()
    }

    /// The whole timeline.
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Says that what was due at a time is handled now.
    pub fn handled(&self, due_ns: u64) {
        if self.timeline.shared.pace == ClockPace::Real {
            let late_ns = self.now_ns().saturating_sub(due_ns);
            self.timeline.shared.state().lateness.count(late_ns);
        }
    }

    /// Waits, in a tokio runtime, until the device's next event is due. Dropped before, it says
    /// that the device is at work again.
    pub async fn wait(&mut self, wait: Wait) {
        if self.timeline.shared.pace == ClockPace::Real {
            return match wait.next_ns {
                Some(next) => {
                    let ns = next.saturating_sub(self.now_ns());
                    tokio::time::sleep(Duration::from_nanos(ns)).await;
                }
                None => std::future::pending().await,
            };
        }
        // What has come meanwhile comes first: the event loop looks at its sources here.
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
        state.go_on(shared.pace);
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        let shared = &self.timeline.shared;
        let mut state = shared.state();
        state.seats.remove(&self.number);
        state.go_on(shared.pace);
    }
}

/// A seat that waits, until this is dropped.
struct Waiting<'a>(&'a Seat);

impl<'a> Waiting<'a> {
    fn new(seat: &'a Seat, wait: Wait) -> Self {
        seat.set(Some(wait));
        Self(seat)
    }

    /// Whether what the device waits for is still to come.
    fn goes_on(&self) -> bool {
        let state = self.0.timeline.shared.state();
        let place = state.seats.get(&self.0.number);
        place.is_some_and(|place| place.waits.is_some())
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
