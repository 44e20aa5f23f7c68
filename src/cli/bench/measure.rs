//! Times one backend: frame rates and passes.

use super::{Adapter, Subject};
use phasmid_render::{Pass, PassTime};
use phasmid_render::{Renderer, shot::Shot};
use phasmid_report::stopwatch::ROUND_S;
use phasmid_study::timing::Timing;
use serde::Serialize;
use std::collections::VecDeque;
use std::hint::black_box;
use std::time::Instant;

/// Maximum number of frames in which a GPU's passes are timed; timing also ends after [`ROUND_S`].
const TIMED: usize = 20;

/// Results of one backend.
#[derive(Debug, Serialize)]
pub(super) struct Run {
    pub(super) backend: &'static str,
    /// Name, driver and kind of the GPU; `None` for the CPU.
    pub(super) adapter: Option<Adapter>,
    /// Frame rate of a static scene.
    pub(super) still: Rate,
    /// Frame rate with the geometry pass in every frame.
    pub(super) moving: Rate,
    /// Times of the passes, with the geometry pass in every frame. CPU: wall-clock time. GPU: its
    /// own timestamps; empty if the adapter has none.
    pub(super) passes: Vec<PassRow>,
}

/// A frame rate.
#[derive(Debug, Serialize)]
pub(super) struct Rate {
    pub(super) frames_per_s: f64,
    /// Time per frame divided by the time of a memory copy of the frame's bytes.
    pub(super) over_copy: f64,
}

/// Time of one pass.
#[derive(Debug, Serialize)]
pub(super) struct PassRow {
    pub(super) pass: String,
    pub(super) runs_per_frame: f64,
    /// Total time of its runs in a frame, in microseconds.
    pub(super) us_per_frame: f64,
}

/// Times the CPU.
pub(super) fn cpu(renderer: &mut Renderer, subject: &Subject<'_>) -> Run {
    let [still, moving] = rates(renderer, subject);
    let pixels = renderer.pixel_count() as f64;
    let mut timing = Timing::new(renderer, &subject.shots, subject.watch);
    let mut row = |name: &str, pass| PassRow {
        pass: name.to_owned(),
        runs_per_frame: 1.0,
        us_per_frame: timing.pass_ns(pass) * pixels * 1e-3,
    };
    Run {
        backend: "cpu",
        adapter: None,
        still,
        moving,
        passes: vec![
            row("geometry", Pass::Geometry),
            row("exposure and sensor", Pass::Exposure),
        ],
    }
}

/// Times the GPU that the renderer uses.
pub(super) fn gpu(renderer: &mut Renderer, subject: &Subject<'_>, adapter: Adapter) -> Run {
    let [still, moving] = rates(renderer, subject);
    renderer.time_passes();
    let mut passes = Vec::new();
    let (begin, mut timed) = (Instant::now(), 0);
    for shot in subject.shots.iter().cycle().take(TIMED) {
        if timed > 0 && begin.elapsed().as_secs_f64() > ROUND_S {
            break;
        }
        timed += 1;
        renderer.invalidate();
        black_box(renderer.expose(shot));
        // Read after every frame: the renderer stores the timestamps of a few passes at a time.
        passes = renderer.pass_times().into_iter().collect();
    }
    let row = |(pass, time): (String, PassTime)| PassRow {
        pass,
        runs_per_frame: time.runs as f64 / f64::from(timed),
        us_per_frame: time.total_ns * 1e-3 / f64::from(timed),
    };
    let mut passes: Vec<PassRow> = passes.into_iter().map(row).collect();
    passes.sort_by(|a, b| b.us_per_frame.total_cmp(&a.us_per_frame));
    Run {
        backend: "gpu",
        adapter: Some(adapter),
        still,
        moving,
        passes,
    }
}

/// Returns the frame rates of a static scene and with the geometry pass in every frame.
fn rates(renderer: &mut Renderer, subject: &Subject<'_>) -> [Rate; 2] {
    [false, true].map(|moving| {
        let seconds = subject
            .watch
            .seconds_a_frame(subject.args.frames as usize, |count| {
                frames(renderer, &subject.shots, count, moving);
            });
        Rate {
            frames_per_s: 1.0 / seconds,
            over_copy: seconds / subject.copy,
        }
    })
}

/// Renders frames, with as many in flight as `Renderer::depth` allows.
fn frames(renderer: &mut Renderer, shots: &[Shot], count: usize, moving: bool) {
    let mut under_way = VecDeque::new();
    for shot in shots.iter().cycle().take(count) {
        if under_way.len() == renderer.depth()
            && let Some(first) = under_way.pop_front()
        {
            black_box(renderer.finish(first));
        }
        if moving {
            renderer.invalidate();
        }
        under_way.push_back(renderer.submit(shot));
    }
    for pending in under_way {
        black_box(renderer.finish(pending));
    }
}
