//! Shows progress on standard error if standard error is a terminal; else shows nothing.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Template of the progress line of an activity of unknown length.
const ACTIVITY: &str = "{spinner} {prefix} {elapsed} {wide_msg}";
/// Template of the progress line of an activity that consists of counted steps.
const STEPS: &str = "{prefix} [{bar:20}] {pos}/{len}{left} {wide_msg}";
/// Interval at which the times in a progress line are updated if nothing else changes.
const TICK: Duration = Duration::from_millis(200);

/// The progress line that is on the terminal, if any.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// A line on the terminal that shows the progress of an activity until this value is dropped. At
/// most one exists at a time.
pub(super) struct ProgressLine {
    bar: ProgressBar,
    estimate: Arc<Mutex<Estimate>>,
}

impl ProgressLine {
    /// Shows a line for an activity. `name` says what is done, or what is counted by [`Self::show`].
    pub(super) fn new(name: &str) -> Self {
        let progress = Self {
            bar: ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr()),
            estimate: Arc::default(),
        };
        // Set the style first, because setting the name draws the line.
        progress.set_style(ACTIVITY);
        progress.rename(name);
        if !progress.bar.is_hidden() {
            lock(&SHOWN).replace(progress.bar.clone());
            progress.bar.tick();
            keep_current(&progress.bar);
        }
        progress
    }

    /// Changes the name.
    pub(super) fn rename(&self, name: &str) {
        self.bar.set_prefix(name.to_owned());
    }

    /// Shows that `done` of `of` steps are done. Estimates the remaining time from the steps since the
    /// first call.
    pub(super) fn show(&self, done: usize, of: usize) {
        let first = lock(&self.estimate).update(done, of, Instant::now());
        self.bar.set_length(of as u64);
        self.bar.set_position(done as u64);
        if first {
            self.set_style(STEPS);
            self.bar.tick();
        }
    }

    /// Shows a remark at the end of the line.
    pub(super) fn remark(&self, text: String) {
        self.bar.set_message(text);
    }

    fn set_style(&self, template: &str) {
        let estimate = self.estimate.clone();
        let left = move |_: &ProgressState, line: &mut dyn fmt::Write| {
            if let Some(left) = lock(&estimate).left(Instant::now()) {
                // If this fails, the line is shown without the estimate.
                let _ = write!(line, ", about {} left", Rounded(left));
            }
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style.with_key("left", left));
        }
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        lock(&SHOWN).take();
        self.bar.finish_and_clear();
    }
}

/// Removes the progress line while a function writes to the terminal.
pub(super) fn aside<T>(write: impl FnOnce() -> T) -> T {
    let shown = lock(&SHOWN).clone();
    match shown {
        Some(bar) => bar.suspend(write),
        None => write(),
    }
}

/// Updates the times of a line until it ends.
fn keep_current(bar: &ProgressBar) {
    let bar = bar.downgrade();
    let thread = std::thread::Builder::new().name("progress".into());
    // Without the thread, a line is updated only when progress is reported.
    let _ = thread.spawn(move || {
        loop {
            std::thread::sleep(TICK);
            match bar.upgrade() {
                Some(bar) if !bar.is_finished() => bar.tick(),
                _ => return,
            }
        }
    });
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Estimates the remaining time of counted steps.
#[derive(Debug, Default)]
struct Estimate {
    /// Number of completed steps and time, at the first report and at the latest report.
    reports: Option<[(usize, Instant); 2]>,
    of: usize,
}

impl Estimate {
    /// Takes a progress report; returns whether it was the first one. If steps are repeated, the
    /// estimate starts anew.
    fn update(&mut self, done: usize, of: usize, now: Instant) -> bool {
        self.of = of;
        let earlier = self.reports;
        self.reports = Some(match earlier {
            Some([first, last]) if done >= last.0 => [first, (done, now)],
            _ => [(done, now); 2],
        });
        earlier.is_none()
    }

    /// Returns the remaining time; `None` until a step has been completed since the first report.
    fn left(&self, now: Instant) -> Option<Duration> {
        let [(begun, begin), (done, at)] = self.reports?;
        if done == begun {
            return None;
        }
        let step_s = at.duration_since(begin).as_secs_f64() / (done - begun) as f64;
        let left_s = step_s * self.of.saturating_sub(done) as f64;
        let left = Duration::try_from_secs_f64(left_s).ok()?;
        Some(left.saturating_sub(now.duration_since(at)))
    }
}

/// A duration in its usual unit.
struct Rounded(Duration);

impl fmt::Display for Rounded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.as_secs_f64() {
            s if s < 90.0 => write!(f, "{s:.0} s"),
            s if s < 5400.0 => write!(f, "{:.0} min", s / 60.0),
            s => write!(f, "{:.1} h", s / 3600.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remaining_time_follows_from_the_steps_since_the_first_report() {
        let begin = Instant::now();
        let at = |s| begin + Duration::from_secs(s);
        let left = |estimate: &Estimate, s| estimate.left(at(s)).map(|left| left.as_secs());
        let mut estimate = Estimate::default();
        assert_eq!(left(&estimate, 0), None);
        // A study that an earlier run left at 50 of 100 trials continues.
        assert!(estimate.update(50, 100, at(0)));
        assert_eq!(left(&estimate, 5), None);
        assert!(!estimate.update(60, 100, at(20)));
        assert_eq!(left(&estimate, 20), Some(80));
        assert_eq!(left(&estimate, 50), Some(50), "time passes without news");
        assert_eq!(left(&estimate, 500), Some(0));
        // A scan is repeated: its step count begins anew.
        estimate.update(1, 10, at(600));
        assert_eq!(left(&estimate, 600), None);
        estimate.update(2, 10, at(601));
        assert_eq!(left(&estimate, 601), Some(8));
        estimate.update(10, 10, at(610));
        assert_eq!(left(&estimate, 610), Some(0));
    }

    #[test]
    fn durations_have_their_usual_unit() {
        for (s, text) in [(0, "0 s"), (89, "89 s"), (90, "2 min"), (9000, "2.5 h")] {
            assert_eq!(Rounded(Duration::from_secs(s)).to_string(), text);
        }
    }

    #[test]
    fn both_lines_are_valid_templates() {
        for template in [ACTIVITY, STEPS] {
            ProgressStyle::with_template(template).unwrap();
        }
    }

    #[test]
    fn messages_are_written_also_without_a_line() {
        let progress = ProgressLine::new("frames");
        progress.show(1, 2);
        assert_eq!(aside(|| 7), 7);
        drop(progress);
        assert_eq!(aside(|| 8), 8);
    }
}
