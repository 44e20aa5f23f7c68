//! Lets viewers of a console calibrate a scanner from the scans that the console shows.

use super::ScanViews;
use phasmid_calibrate::rig::{Calibration, Gathering, Looked, look, look_at_photograph};
use phasmid_calibrate::solve::{Choice, PointResidual};
use phasmid_console::{Calibration as Step, Measurement, Operator, Request, Source};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, Known, check_sequence};
use phasmid_geometry::Board;
use phasmid_protocol::Frame;
use serde_json::{Value, json};
use std::any::Any;
use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of poses.
const MAX_POSES: usize = 200;
/// Columns and rows of the grid of cells into which an image is divided. Coverage is the fraction of
/// cells that contain points.
const CELLS: [usize; 2] = [8, 6];
/// Minimum time between two searches for a board in live frames.
const SOON: Duration = Duration::from_millis(300);

/// Lets viewers of a source calibrate its scanner: they search the source's latest image for a
/// board, take scans as poses, and solve for the rig.
pub(super) fn let_calibrate(source: &Source) {
    source.operate(Arc::new(Calibrator {
        source: source.clone(),
        state: Mutex::new(State::new(Board::DOTS)),
        sight: Mutex::default(),
    }));
}

struct Calibrator {
    source: Source,
    state: Mutex<State>,
    /// The board in the last image; locked during a search.
    sight: Mutex<Option<Sight>>,
}

/// The poses and their solution.
struct State {
    board: Board,
    /// Number of times that the board was changed.
    boards: u64,
    /// Number of changes so far. Viewers compare it with the number they know, to notice that their
    /// list of poses is outdated.
    changes: u64,
    poses: Vec<Pose>,
    /// Number of the pose that was taken last. Numbers are not reused.
    numbered: u64,
    solved: Option<Solved>,
}

/// A scan of the board.
#[derive(Clone)]
struct Pose {
    number: u64,
    looked: Looked,
}

/// A solution.
struct Solved {
    /// Numbers of the poses that were passed to the solver.
    numbers: Vec<u64>,
    calibration: Calibration,
}

/// An image in which a board is looked for.
#[derive(Clone)]
enum Image {
    Frame(Arc<Frame>),
    Scan(Arc<dyn Measurement>),
}

/// The result of searching an image for a board.
struct Sight {
    board: Board,
    image: Image,
    /// Positions of the board's points in pixels, or why no board was found.
    found: std::result::Result<Vec<[f64; 2]>, String>,
    size: [u32; 2],
    /// Time of the search.
    at: Instant,
    /// The data that the calibration uses, if the image is a scan.
    looked: Option<Looked>,
}

impl State {
    fn new(board: Board) -> Self {
        Self {
            board,
            boards: 0,
            changes: 0,
            poses: Vec::new(),
            numbered: 0,
            solved: None,
        }
    }

    /// # Errors
    /// Returns an error if the board was changed since `boards` was read.
    fn check(&self, boards: u64) -> Result<()> {
        match self.boards == boards {
            true => Ok(()),
            false => Err(Error::device("the board has been changed meanwhile")),
        }
    }

    fn numbers(&self) -> Vec<u64> {
        self.poses.iter().map(|pose| pose.number).collect()
    }

    fn about(&self) -> Value {
        let size = self
            .poses
            .last()
            .map_or([0, 0], |pose| pose.looked.camera_px);
        let poses = self.poses.iter().map(|pose| self.about_pose(pose));
        let solution = self.solved.as_ref().map(|solved| {
            let Calibration {
                solution, warnings, ..
            } = &solved.calibration;
            let rig = { solution.parameters.iter() }.filter(|parameter| {
                { ["camera.", "projector."].iter() }.any(|of| parameter.name.starts_with(of))
            });
            let rig = rig.map(|parameter| {
                let (name, unit) = (&parameter.name, parameter.unit);
                json!({ "name": name, "unit": unit, "value": parameter.value, "sd": parameter.sigma })
            });
            json!({
                "toml": solution.rig.to_toml(),
                "fresh": solved.numbers == self.numbers(),
                "camera_rms_px": solution.camera_errors.rms_px,
                "projector_rms_px": solution.projector_errors.rms_px,
                "variance_factor": solution.variance_factor,
                "parameters": rig.collect::<Vec<_>>(),
                "warnings": warnings,
            })
        });
        json!({
            "changes": self.changes,
            "board": self.board,
            "size": size,
            "covered": covered(size, self.poses.iter().flat_map(|pose| positions(&pose.looked))),
            "poses": poses.collect::<Vec<_>>(),
            "solution": solution,
        })
    }

    /// Describes a pose for viewers: the position of each point and, if the solver has used the
    /// pose, the residual of each point.
    fn about_pose(&self, pose: &Pose) -> Value {
        let given = { self.solved.as_ref() }.and_then(|solved| {
            let at = solved.numbers.iter().position(|&n| n == pose.number)?;
            Some((&solved.calibration.solution, at))
        });
        let used = given.and_then(|(solution, at)| solution.poses.iter().find(|p| p.given == at));
        let why = given.and_then(|(solution, at)| {
            let left_out = solution.left_out.iter().find(|p| p.given == at);
            left_out.map(|pose| pose.why.to_string())
        });
        let residual = |r: &PointResidual| (r.index, r.camera_px);
        let residuals: HashMap<_, _> = { used.iter() }
            .flat_map(|used| used.points.iter().map(residual))
            .collect();
        let data = pose.looked.found.iter();
        let points = data.clone().flat_map(|data| &data.seen).map(|seen| {
            let residual = residuals.get(&seen.index).copied();
            { seen.px.to_array() }
                .map(rounded)
                .into_iter()
                .chain(residual.into_iter().flatten())
        });
        let points: Vec<Vec<f64>> = points.map(Iterator::collect).collect();
        let solved = used.map(|used| {
            json!({
                "camera_rms_px": used.camera_errors.rms_px,
                "projector_rms_px": used.projector_errors.rms_px,
                "tilt_deg": used.tilt_deg(),
                "distance_mm": used.camera_from_board.translation_mm.length(),
            })
        });
        json!({
            "number": pose.number,
            "points": points,
            "lit": data.map(phasmid_calibrate::rig::PoseData::lit).sum::<usize>(),
            "solved": solved,
            "why": why,
        })
    }
}

/// Rounds a position to hundredths of a pixel, which is fine enough for drawing.
fn rounded(px: f64) -> f64 {
    (100.0 * px).round() / 100.0
}

/// Returns the positions of the points of a board in pixels.
fn positions(looked: &Looked) -> impl Iterator<Item = [f64; 2]> {
    let seen = { looked.found.iter() }.flat_map(|data| &data.seen);
    seen.map(|seen| seen.px.to_array())
}

/// Returns the fraction of an image's cells that contain points.
fn covered(size: [u32; 2], points: impl Iterator<Item = [f64; 2]>) -> f64 {
    let cell = |px: [f64; 2]| {
        [0, 1].map(|axis| {
            let part = px[axis] / f64::from(size[axis].max(1));
            ((part * CELLS[axis] as f64) as usize).min(CELLS[axis] - 1)
        })
    };
    let cells: BTreeSet<_> = points.map(cell).collect();
    cells.len() as f64 / (CELLS[0] * CELLS[1]) as f64
}

impl Image {
    /// Returns whether two values refer to the same image in memory, not merely to images with
    /// equal content.
    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Frame(one), Self::Frame(other)) => Arc::ptr_eq(one, other),
            (Self::Scan(one), Self::Scan(other)) => Arc::ptr_eq(one, other),
            _ => false,
        }
    }

    /// Returns the frames of a scan.
    fn capture(&self) -> Option<&Capture> {
        let Self::Scan(measurement) = self else {
            return None;
        };
        let measurement: &dyn Any = &**measurement;
        let views = measurement.downcast_ref::<ScanViews>()?;
        Some(views.capture())
    }

    fn look(self, board: Board) -> Sight {
        let (size, found, looked) = match (&self, self.capture()) {
            (Self::Frame(frame), _) => {
                let size = [frame.width, frame.height];
                let image = Frame::clone(frame).into_image();
                let seen = image.and_then(|image| look_at_photograph(&board, &image));
                let found = match seen {
                    Ok(Ok(seen)) => Ok(seen.iter().map(|seen| seen.px.to_array()).collect()),
                    Ok(Err(why)) => Err(why.to_string()),
                    Err(why) => Err(why.to_string()),
                };
                (size, found, None)
            }
            (Self::Scan(_), Some(capture)) => {
                let (manifest, images) = (&capture.manifest, &capture.images);
                let known = Known::new(true, capture.calibration.as_ref());
                let checked = check_sequence(manifest, images, known);
                let checked = checked.map_err(|doubt| Error::device(doubt.to_string()));
                let looked = checked
                    .and_then(|()| look(&board, "scan", manifest, images, capture.calibration));
                match looked {
                    Ok(looked) => {
                        let found = match &looked.found {
                            Ok(_) => Ok(positions(&looked).collect()),
                            Err(why) => Err(why.to_string()),
                        };
                        (looked.camera_px, found, Some(looked))
                    }
                    Err(why) => ([0, 0], Err(why.to_string()), None),
                }
            }
            (Self::Scan(_), None) => ([0, 0], Err("the scan has no frames".into()), None),
        };
        Sight {
            board,
            image: self,
            found,
            size,
            at: Instant::now(),
            looked,
        }
    }
}

impl Sight {
    fn about(&self) -> Value {
        let of = self.board.grid();
        let points = { self.found.as_ref() }.map_or(&[][..], Vec::as_slice);
        let points = points.iter().map(|point| point.map(rounded));
        json!({
            "scan": matches!(self.image, Image::Scan(_)),
            "size": self.size,
            "points": points.collect::<Vec<_>>(),
            "of": of[0] * of[1],
            "why": self.found.as_ref().err(),
        })
    }
}

impl Calibrator {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Searches the image that `choose` returns for the board. If the last search was in the same
    /// image, uses its result. Viewers that ask at the same time wait for each other and share one
    /// result.
    fn look<T>(
        &self,
        choose: impl FnOnce(Option<&Sight>) -> Option<Image>,
        tell: impl FnOnce(&Sight) -> T,
    ) -> Option<T> {
        let mut sight = self.sight.lock().unwrap_or_else(PoisonError::into_inner);
        let board = self.state().board;
        let known = sight.take().filter(|known| known.board == board);
        let image = choose(known.as_ref())?;
        let known = known.filter(|known| known.image.is(&image));
        Some(tell(
            sight.insert(known.unwrap_or_else(|| image.look(board))),
        ))
    }

    /// Searches the latest frame for the board, or the last scan if the frame shows a pattern.
    fn look_at_latest(&self) -> Value {
        let choose = |known: Option<&Sight>| {
            if let Some(known) = known.filter(|known| known.at.elapsed() < SOON) {
                return Some(known.image.clone());
            }
            let frame = self.source.frame();
            let free = { frame.as_ref() }.is_some_and(|frame| frame.pattern_index.is_none());
            let scan = self.source.measurement().filter(|_| !free);
            { scan.map(Image::Scan) }.or(frame.map(Image::Frame))
        };
        self.look(choose, Sight::about).unwrap_or_default()
    }

    /// Takes the last scan as a pose.
    fn take(&self) -> Result<Value> {
        let boards = self.state().boards;
        let scan = |_: Option<&Sight>| self.source.measurement().map(Image::Scan);
        let taken = self.look(scan, |sight| {
            let looked = sight.looked.as_ref().filter(|_| sight.found.is_ok());
            let looked = looked.map(|looked| Looked {
                picture: image::RgbImage::default(),
                ..looked.clone()
            });
            looked.ok_or_else(|| sight.found.clone().err().unwrap_or_default())
        });
        let taken = taken.ok_or_else(|| Error::device("there is no scan yet"))?;
        let looked = taken.map_err(Error::device)?;
        let mut state = self.state();
        state.check(boards)?;
        if state.poses.len() == MAX_POSES {
            return Err(Error::device(format!(
                "there are {MAX_POSES} poses already"
            )));
        }
        if { state.poses.iter() }.any(|pose| pose.looked.found == looked.found) {
            return Err(Error::device("this scan is a pose already; scan again"));
        }
        state.numbered += 1;
        let number = state.numbered;
        state.poses.push(Pose { number, looked });
        state.changes += 1;
        Ok(state.about())
    }

    fn solve(&self) -> Result<Value> {
        let state = self.state();
        let (board, boards, poses) = (state.board, state.boards, state.poses.clone());
        drop(state);
        let numbers: Vec<_> = poses.iter().map(|pose| pose.number).collect();
        let names = numbers.iter().map(|number| format!("pose {number}"));
        let mut gathering = Gathering::new(names.collect());
        for (place, pose) in poses.into_iter().enumerate() {
            gathering.take(place, Ok(pose.looked));
        }
        let gathered = gathering.finish();
        let solved = gathered.calibrate(&board, Choice::default());
        let mut calibration = solved.map_err(|why| Error::device(why.to_string()))?;
        // The solution counts usable poses only: convert its indices to indices among all poses.
        let solution = &mut calibration.solution;
        let given = { solution.poses.iter_mut() }.map(|pose| &mut pose.given);
        let left_out = { solution.left_out.iter_mut() }.map(|pose| &mut pose.given);
        for given in given.chain(left_out) {
            *given = gathered.places[*given];
        }
        let missed = { calibration.missed.iter() }.map(|m| format!("{}: {}", m.name, m.why));
        let missed: Vec<_> = missed.collect();
        calibration.warnings.extend(missed);
        let mut state = self.state();
        state.check(boards)?;
        if state.poses.is_empty() {
            return Err(Error::device("the poses have been forgotten meanwhile"));
        }
        state.changes += 1;
        state.solved = Some(Solved {
            numbers,
            calibration,
        });
        Ok(state.about())
    }

    fn step(&self, step: &Step) -> Result<Value> {
        match step {
            Step::Look {} => {
                let sight = self.look_at_latest();
                Ok(json!({ "changes": self.state().changes, "sight": sight }))
            }
            Step::State {} => Ok(self.state().about()),
            Step::Board(board) => {
                { board.check() }.map_err(|(field, found, allowed)| {
                    Error::input(format!("board: {field}"), found, allowed)
                })?;
                let mut state = self.state();
                if state.board != *board {
                    // A request that a viewer made for the previous board now fails in
                    // `State::check`.
                    *state = State {
                        boards: state.boards + 1,
                        changes: state.changes + 1,
                        numbered: state.numbered,
                        ..State::new(*board)
                    };
                }
                Ok(state.about())
            }
            Step::Take {} => self.take(),
            Step::Forget { pose } => {
                let mut state = self.state();
                let is_kept = |known: &Pose| pose.is_some_and(|number| known.number != number);
                state.poses.retain(is_kept);
                state.changes += 1;
                if state.poses.is_empty() {
                    state.solved = None;
                }
                Ok(state.about())
            }
            Step::Solve {} => self.solve(),
        }
    }
}

impl Operator for Calibrator {
    fn answers(&self) -> &'static [&'static str] {
        &["calibration"]
    }

    fn answer(&self, request: &Request) -> Result<Value> {
        match request {
            Request::Calibration(step) => self.step(step),
            _ => Err(Error::device("only a calibration is made here")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Console, ConsoleOptions, Device};
    use phasmid_geometry::board_poses::{Wanted, poses};
    use phasmid_profile::{Profile, Scene, Shape};

    #[test]
    fn image_is_covered_where_points_are() {
        let all = |step: usize| {
            (0..640).step_by(step).flat_map(move |x| {
                (0..480)
                    .step_by(step)
                    .map(move |y| [f64::from(x), f64::from(y)])
            })
        };
        assert_eq!(covered([640, 480], all(80)), 1.0);
        assert_eq!(
            covered([640, 480], [[0.0, 0.0], [1.0, 1.0]].into_iter()),
            1.0 / 48.0
        );
        assert_eq!(
            covered([640, 480], [[640.0, 480.0]].into_iter()),
            1.0 / 48.0
        );
        assert_eq!(covered([0, 0], [].into_iter()), 0.0);
    }

    #[test]
    fn scans_of_a_board_calibrate_the_scanner() {
        let profile = Profile::load("webcam-grey").unwrap();
        let board = Board::DOTS.scaled(profile.calibration.board_scale.unwrap_or(1.0));
        let mut scene = Scene::load("board").unwrap();
        scene.object[0].shape = Shape::Board { board, ink: 0.06 };
        let sequence = profile.calibration_sequence().unwrap().name.clone();
        let wanted = Wanted {
            count: 5,
            distance_mm: profile.calibration.distance_mm,
            ..Wanted::default()
        };
        let builder = Device::builder().profile(profile).scene(scene);
        let mut device = builder.build().unwrap();

        let console = Console::start(&ConsoleOptions::default()).unwrap();
        let source = console.source("bench");
        let calibrator = Calibrator {
            source: source.clone(),
            state: Mutex::new(State::new(Board::DOTS)),
            sight: Mutex::default(),
        };
        let step = |step: Step| calibrator.step(&step);
        let nothing = step(Step::Look {}).unwrap();
        assert_eq!(nothing, json!({ "changes": 0, "sight": null }));
        let refused = |words: &str, wrong: Step| {
            let error = step(wrong).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        };
        refused("no scan", Step::Take {});
        refused(
            "columns: 2; expected 7 to 199",
            Step::Board(Board::Dots {
                columns: 2,
                rows: 9,
                pitch_mm: 6.0,
                dot_mm: 2.5,
                marker_mm: 5.0,
            }),
        );
        step(Step::Board(board)).unwrap();
        refused("poses", Step::Solve {});
        let mut state = Value::Null;
        for rig_from_board in poses(&board, &device.rig(), &wanted).unwrap() {
            let (position_mm, rotation_deg) = rig_from_board.to_xyz_deg();
            device.place(0, position_mm, rotation_deg).unwrap();
            source.show(Arc::new(ScanViews::new(device.scan(&sequence).unwrap())));
            let sight = step(Step::Look {}).unwrap()["sight"].take();
            // The board may extend beyond the image, so not all of its points are found.
            assert!(sight["points"].as_array().unwrap().len() > 400, "{sight}");
            state = step(Step::Take {}).unwrap();
        }
        refused("already", Step::Take {});
        assert_eq!(state["poses"].as_array().unwrap().len(), 5);
        let one = step(Step::Forget { pose: Some(2) }).unwrap()["covered"]
            .as_f64()
            .unwrap();
        assert!(one > 0.2 && one <= state["covered"].as_f64().unwrap());
        state = step(Step::Solve {}).unwrap();
        assert_eq!(state["solution"]["fresh"], true);
        let rms = state["poses"][1]["solved"]["camera_rms_px"]
            .as_f64()
            .unwrap();
        assert!(rms > 0.001 && rms < 0.2, "{rms}");
        assert_eq!(state["poses"][1]["number"], 3);
        assert_eq!(state["poses"][1]["points"][0].as_array().unwrap().len(), 4);
        let toml = state["solution"]["toml"].as_str().unwrap();
        let found = phasmid_geometry::Rig::from_toml(toml, "solution").unwrap();
        let off = found.camera.lens.focal_px()[0] / device.rig().camera.lens.focal_px()[0] - 1.0;
        assert!(off.abs() < 0.01, "{off}");
        state = step(Step::Forget { pose: None }).unwrap();
        assert_eq!(
            (&state["solution"], &state["covered"]),
            (&Value::Null, &json!(0.0))
        );
    }
}
