//! Frames that only count: a lost, exchanged or repeated one is told from the pictures alone, and a
//! sound capture is never doubted.

use phasma::emulator::{Bench, Firmware, FrameSink, Renderer};
use phasma::error::Error;
use phasma::host::{
    Camera, Captured, MemoryCamera, MemoryPort, ScanOptions, Scanner, check_sequence,
};
use phasma::profile::{Profile, Scene};
use phasma::protocol::Frame;
use std::sync::Arc;
use std::time::Duration;

const SHORT: Duration = Duration::from_millis(20);

/// What the way from the device to the camera does to the frames of a run.
type Change = fn(Vec<Frame>) -> Vec<Frame>;

/// A link that carries no identity; frames of the first `bad_runs` runs are changed.
struct Way {
    camera: MemoryCamera,
    held: Vec<Frame>,
    frames_a_run: usize,
    change: Change,
    bad_runs: usize,
    sent: u64,
}

impl FrameSink for Way {
    fn attended(&self) -> bool {
        true
    }

    fn put(&mut self, frame: Arc<Frame>) {
        self.held.push((*frame).clone());
        if self.held.len() < self.frames_a_run {
            return;
        }
        let mut frames = std::mem::take(&mut self.held);
        if self.bad_runs > 0 {
            self.bad_runs -= 1;
            frames = (self.change)(frames);
        }
        for frame in frames {
            self.camera.put(Frame {
                id: self.sent,
                pattern_index: None,
                exposure_start_ns: 0,
                exposure_end_ns: 0,
                ..frame
            });
            self.sent += 1;
        }
    }
}

/// A camera whose frames only count.
struct Counting(MemoryCamera);

impl Camera for Counting {
    fn info(&self) -> &str {
        self.0.info()
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>, Error> {
        self.0.next_frame(timeout)
    }

    fn identifies(&self) -> bool {
        false
    }
}

fn scan(
    profile: &Profile,
    scene: &str,
    change: Change,
    bad_runs: usize,
) -> Result<Captured, Error> {
    let camera = MemoryCamera::default();
    let mut bench = Bench::new(
        Firmware::new(profile, &[]).unwrap(),
        Renderer::new(profile, &Scene::load(scene).unwrap(), 7).unwrap(),
        Way {
            camera: camera.clone(),
            held: Vec::new(),
            frames_a_run: profile.sequence[0].frame.len(),
            change,
            bad_runs,
            sent: 0,
        },
    );
    let port = MemoryPort::new(move |bytes: &[u8]| bench.control(bytes));
    let mut scanner = Scanner::new(port, SHORT, || Ok(Counting(camera)))?;
    let options = ScanOptions {
        sequence: None,
        manifest: None,
        frame_timeout: SHORT,
    };
    scanner.scan(&options, &mut |_| {})
}

fn profile(name: &str, dimmed: f64) -> Profile {
    let mut profile = Profile::load(name).unwrap();
    profile.projector.radiant_intensity_w_sr *= dimmed;
    // A line would name the frames.
    profile.camera.data_line = false;
    profile
}

/// Every capture that is looked at: both built-in sequences, all scenes, and a dim projector.
fn captures(name: &str) -> impl Iterator<Item = (String, Captured)> {
    let scenes = phasma::profile::scene_names().map(|scene| (scene, 1.0));
    scenes
        .chain([("plane", 0.15), ("torso", 0.15)])
        .map(move |(scene, dimmed)| {
            let what = format!("{name}, {scene}, {dimmed} of the light");
            let captured = scan(&profile(name, dimmed), scene, |frames| frames, 0);
            let captured = captured.unwrap_or_else(|e| panic!("{what}: {e}"));
            (what, captured)
        })
}

/// Every single fault of a run whose count is right: a frame lost (and another one at the end), a
/// frame twice (and the last one cut), neighbours exchanged.
fn faults(frames: &[Frame]) -> Vec<(String, Vec<Frame>)> {
    let n = frames.len();
    let mut all = Vec::new();
    for k in 0..n {
        let mut lost = frames.to_vec();
        lost.remove(k);
        for (with, last) in [("its last frame", n - 1), ("its first frame", 0)] {
            let mut filled = lost.clone();
            filled.push(frames[last].clone());
            // The last frame, lost and sent again, is a sound run.
            if k != last {
                all.push((format!("{k} lost, then {with}"), filled));
            }
        }
        if k + 1 < n {
            let mut twice = frames.to_vec();
            twice.insert(k, frames[k].clone());
            twice.pop();
            all.push((format!("{k} twice"), twice));
            let mut exchanged = frames.to_vec();
            exchanged.swap(k, k + 1);
            all.push((format!("{k} and {} exchanged", k + 1), exchanged));
        }
    }
    all
}

fn every_fault_is_found(name: &str) {
    for (what, captured) in captures(name) {
        assert!(captured.check_modulation().is_ok(), "{what}");
        let missed: Vec<String> = faults(&captured.frames)
            .into_iter()
            .filter(|(_, frames)| check_sequence(&captured.manifest, frames).is_ok())
            .map(|(fault, _)| fault)
            .collect();
        assert!(missed.is_empty(), "{what}: {missed:?}");
    }
}

#[test]
fn every_fault_of_twelve_steps_is_found_and_no_sound_capture_doubted() {
    every_fault_is_found("pmp-bench");
}

#[test]
fn every_fault_of_four_steps_is_found_and_no_sound_capture_doubted() {
    every_fault_is_found("webcam-grey");
}

#[test]
fn a_fault_is_named_and_the_run_repeated_once() {
    let quick = profile("webcam-grey", 1.0);
    for (change, needle) in [
        (
            (|mut frames| {
                frames.swap(5, 6);
                frames
            }) as Change,
            "frames 5 and 6 look exchanged",
        ),
        (
            |mut frames| {
                frames.remove(4);
                frames
            },
            "pattern 12 of 13 is missing: no frame within 0.02 s after 12 of 13 frames",
        ),
        (
            |mut frames| {
                frames.insert(4, frames[4].clone());
                frames
            },
            "all 13 patterns had come",
        ),
    ] {
        assert_eq!(scan(&quick, "plane", change, 1).unwrap().frames.len(), 13);
        let error = scan(&quick, "plane", change, 2).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        let message = error.to_string();
        assert!(message.contains("two runs failed"), "{message}");
        assert!(message.contains(needle), "{needle} not in: {message}");
    }
}

#[test]
fn a_camera_that_does_not_see_the_projector_is_told_so() {
    let mut captured = scan(&profile("webcam-grey", 1.0), "plane", |frames| frames, 0).unwrap();
    let lit = captured.frames[11].clone();
    // A still picture with noise, and a counter that changes in one corner.
    for (k, frame) in captured.frames.iter_mut().enumerate() {
        let mut state = k as u64 + 1;
        for (pixel, seen) in frame.data.iter_mut().zip(&lit.data) {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            *pixel = seen.saturating_add((state >> 62) as u8);
        }
        for row in 0..16 {
            for column in 0..60 {
                let on = (column / 2 + row / 2 + k * (1 + column / 8)) % 3 == 0;
                frame.data[row * frame.width as usize + column] = if on { 250 } else { 5 };
            }
        }
    }
    assert_eq!(check_sequence(&captured.manifest, &captured.frames), Ok(()));
    let error = captured.check_modulation().unwrap_err();
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().contains("no modulation"), "{error}");
}
