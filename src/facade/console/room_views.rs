//! Shows the tracking of a patient in a console.

use super::ScanViews;
use super::scan_views::field;
use crate::facade::ask_service;
use crate::facade::{TrackOptions, TrackProgress, Tracked};
use glam::DVec3;
use phasmid_console::{Console, Room, RoomRow, RoomScan, Source, Stated, Surface};
use phasmid_decode::Capture;
use phasmid_geometry::{Mesh, Pose};
use phasmid_profile::RigPlace;
use phasmid_protocol::record::Observer;
use phasmid_protocol::service::Request;
use phasmid_sgrt::{Beam, Measured, MotionState, Planned};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

/// Distance from the planned skin, in millimetres, beyond which a point is not counted as skin.
const FAR_MM: f64 = 50.0;
/// Maximum number of results for which the truth has been requested and has not arrived.
const WAITING: usize = 64;

/// Shows the tracking of a patient: the room with the planned and the tracked surface, the results as curves
/// with their standard deviations, the state of the beam, and each pod as a scanner.
///
/// ```no_run
/// use phasmid::track::Planned;
/// use phasmid::{Console, ConsoleOptions, Pod, RoomViews, TrackOptions};
///
/// # fn pods() -> Result<Vec<Pod>, phasmid::Error> { Ok(Vec::new()) }
/// let planned = Planned::load("planning")?;
/// let mut pods = pods()?;
/// let options = TrackOptions::default();
/// let console = Console::start(&ConsoleOptions::default())?;
/// let places = pods.iter().map(|pod| (pod.name(), pod.place()));
/// let mut views = RoomViews::new(&console, &planned, places, &options);
/// println!("open {}", console.url());
/// phasmid::track(&mut pods, &planned, &options, |progress| views.show(&progress))?;
/// # Ok::<(), phasmid::Error>(())
/// ```
pub struct RoomViews<'a> {
    planned: &'a Planned,
    source: Source,
    pods: Vec<Pod>,
    room: Room,
    /// The thread that asks for the truth, if there is an emulated device.
    truths: Option<SyncSender<(u64, Duration)>>,
    /// Threads that compute the views of the pods, separate from the threads of tracking.
    pool: Option<Arc<ThreadPool>>,
    begun: Instant,
    /// Time of the last result in seconds.
    last_s: f64,
    /// The last result, until the surface of its scan is reported.
    tracked: Option<Tracked>,
}

/// A pod, shown as a scanner of its own.
struct Pod {
    source: Source,
    room_from_rig: Pose,
    /// Whether the pod's field of view is known.
    known: bool,
    /// Path of the pod's service channel.
    service: Option<PathBuf>,
}

/// The patient in a scan, with figures of the part that each pod saw.
struct Sighted {
    scan: RoomScan,
    points: Vec<usize>,
    coverage: Vec<f64>,
}

impl<'a> RoomViews<'a> {
    /// Adds the room and its pods to a console. `pods` are the names and places of the pods, as for
    /// [`Tracker::new`](crate::Tracker::new).
    pub fn new<'p>(
        console: &Console,
        planned: &'a Planned,
        pods: impl IntoIterator<Item = (&'p str, RigPlace)>,
        options: &TrackOptions,
    ) -> Self {
        let source = console.source("room");
        let mut names = Vec::new();
        let pod = |(name, place): (&str, RigPlace)| {
            names.push(name.to_owned());
            let source = console.source(name);
            source.restart(false);
            Pod {
                source,
                room_from_rig: Pose::from_xyz_deg(
                    DVec3::from_array(place.position_mm),
                    DVec3::from_array(place.rotation_deg),
                ),
                known: false,
                service: None,
            }
        };
        let pods = pods.into_iter().map(pod).collect();
        let reference = &planned.reference;
        let room = Room {
            pods: names,
            fields: Vec::new(),
            target_mm: planned.tumour_mm().to_array(),
            tolerance_mm: options.tolerance_mm,
            skin: surface(reference.vertices(), reference.triangles()),
            tumour: surface(&planned.tumour.vertices, &planned.tumour.triangles),
        };
        source.show_room(Arc::new(room.clone()));
        Self {
            planned,
            source,
            pods,
            room,
            truths: None,
            pool: ThreadPoolBuilder::new()
                .num_threads(1)
                .build()
                .ok()
                .map(Arc::new),
            begun: Instant::now(),
            last_s: 0.0,
            tracked: None,
        }
    }

    /// Shows the truth too: the true depth of the scans of an emulated pod, and the tumour's true
    /// position. Both come from the pod's service channel; `pod` is the index of the pod.
    ///
    /// # Panics
    /// Panics if `pod` is not the index of a pod.
    #[must_use]
    pub fn with_service(mut self, pod: usize, service: impl Into<PathBuf>) -> Self {
        let service = service.into();
        self.pods[pod].service = Some(service.clone());
        if self.truths.is_none() {
            let (source, target_mm) = (self.source.clone(), self.room.target_mm);
            let (send, wanted) = sync_channel(WAITING);
            let thread = thread::Builder::new().name("truth".into());
            let thread = thread.spawn(move || {
                for (result, middle) in wanted {
                    if let Some(truth) = truth(&service, middle, target_mm) {
                        source.add_truth(result, truth);
                    }
                }
            });
            // If the thread cannot be started, the truth is not shown.
            self.truths = thread.is_ok().then_some(send);
        }
        self
    }

    /// Returns the observer for the traffic of a pod, by its index, for
    /// [`Scanner::observed`](crate::Scanner::observed).
    ///
    /// # Panics
    /// Panics if `pod` is not the index of a pod.
    pub fn observer(&self, pod: usize) -> Observer {
        self.pods[pod].source.observer()
    }

    /// Shows a progress report of tracking.
    pub fn show(&mut self, progress: &TrackProgress<'_>) {
        match progress {
            TrackProgress::Scan(tracked) => self.tracked = Some((*tracked).clone()),
            TrackProgress::Surface {
                measured,
                state,
                captures,
            } => self.surface(measured, *state, captures),
            TrackProgress::Overdue { scan, beam } => {
                let row = RoomRow {
                    scan: *scan,
                    time_s: self.last_s,
                    held: held(beam),
                    ..RoomRow::default()
                };
                self.source.show_tracked(row, Arc::default());
            }
            TrackProgress::Doubtful { pod, why } => {
                self.source.say(Some(format!("{pod}: {why}")));
            }
            TrackProgress::Waiting => {}
        }
    }

    /// Shows the last result with its surface, and the captures of the pods.
    fn surface(
        &mut self,
        measured: &Measured,
        state: Option<&MotionState>,
        captures: &[Arc<Capture>],
    ) {
        let Some(tracked) = self.tracked.take() else {
            return;
        };
        let Sighted {
            scan,
            points,
            coverage,
        } = self.look(measured, state);
        let row = self.row(&tracked, points, coverage);
        self.last_s = row.time_s;
        let result = self.source.show_tracked(row, Arc::new(scan));
        if let (Some(truths), Some(middle)) = (&self.truths, tracked.middle) {
            // If the queue is full because a device does not answer, skip this request.
            let _ = truths.try_send((result, middle));
        }
        for (index, capture) in captures.iter().enumerate() {
            self.captured(index, capture);
        }
    }

    fn captured(&mut self, index: usize, capture: &Arc<Capture>) {
        let Some(pod) = self.pods.get_mut(index) else {
            return;
        };
        if let Some(rig) = capture.calibration.as_ref().filter(|_| !pod.known) {
            pod.known = true;
            let mut field = field(self.room.pods[index].clone(), &rig.camera);
            field.apex = pod.room_from_rig.point(field.apex);
            field.corners = { field.corners }.map(|corner| pod.room_from_rig.direction(corner));
            self.room.fields.push(field);
            self.source.show_room(Arc::new(self.room.clone()));
        }
        let mut views = ScanViews::new(capture.clone());
        if let Some(pool) = &self.pool {
            views = views.in_pool(pool.clone());
        }
        if let Some(service) = &pod.service {
            views = views.with_service(service);
        }
        pod.source.show(Arc::new(views));
    }

    /// Compares the points of a scan with the planned skin, and moves the planned surfaces to the
    /// tracked position.
    fn look(&self, measured: &Measured, state: Option<&MotionState>) -> Sighted {
        let Planned {
            reference, model, ..
        } = self.planned;
        let feet: Vec<_> = { measured.points().par_iter() }
            .map(|point| {
                let foot = reference.closest(*point);
                let off = (*point - foot.point).dot(foot.normal);
                let is_skin = reference.is_inside(foot.triangle) && off.abs() < FAR_MM;
                (is_skin && !foot.border).then_some((foot.triangle, off))
            })
            .collect();
        let points = measured.points().iter().zip(&feet).map(|(point, foot)| {
            let [x, y, z] = point.as_vec3().to_array();
            [x, y, z, foot.map_or(f32::NAN, |(_, off)| off as f32)]
        });
        let area_mm2 = reference.area_mm2();
        let of = |pod: usize| {
            let seen = measured.pods().iter().zip(&feet);
            seen.filter(move |(number, _)| usize::from(**number) == pod)
        };
        let coverage = |pod: usize| {
            let seen = of(pod).filter_map(|(_, foot)| foot.map(|(triangle, _)| triangle));
            reference.covered_mm2(seen) / area_mm2
        };
        let (skin, tumour) = state.map_or_else(Default::default, |state| {
            let MotionState {
                room_from_reference: room,
                coefficients,
            } = state;
            let moved = reference.vertices().par_iter().enumerate();
            let skin = moved.map(|(i, vertex)| {
                let moved = *vertex + model.skin(i, coefficients).as_dvec3();
                room.point(moved).as_vec3().to_array()
            });
            let Mesh { vertices, .. } = model.tumour(coefficients);
            let tumour = vertices.iter().map(|v| room.point(*v).as_vec3().to_array());
            (skin.collect(), tumour.collect())
        });
        Sighted {
            scan: RoomScan {
                points: points.collect(),
                skin,
                tumour,
            },
            points: (0..self.pods.len()).map(|pod| of(pod).count()).collect(),
            coverage: (0..self.pods.len()).map(coverage).collect(),
        }
    }

    fn row(&self, tracked: &Tracked, points: Vec<usize>, coverage: Vec<f64>) -> RoomRow {
        let stated =
            |values: [f64; 3], sd: [f64; 3]| [0, 1, 2].map(|i| -> Stated { [values[i], sd[i]] });
        let target_mm = DVec3::from_array(self.room.target_mm);
        let tumour = tracked.tumour.as_ref();
        RoomRow {
            scan: tracked.scan,
            time_s: match tracked.time {
                Duration::ZERO => self.begun.elapsed(),
                time => time,
            }
            .as_secs_f64(),
            skin: tracked.skin.map(|skin| {
                let [a, b, c] = stated(skin.shift_mm, skin.shift_sd_mm);
                let [d, e, f] = stated(skin.rotation_deg, skin.rotation_sd_deg);
                [a, b, c, d, e, f]
            }),
            tumour: tumour.map(|tumour| {
                let shift = DVec3::from_array(tumour.position_mm) - target_mm;
                let [x, y, z] = stated(shift.to_array(), tumour.sd_mm);
                [x, y, z, [tumour.off_mm, tumour.off_sd_mm]]
            }),
            truth: None,
            held: held(&tracked.beam),
            warnings: tracked.warnings.iter().map(ToString::to_string).collect(),
            points,
            coverage,
            covered: tumour.map(|tumour| tumour.coverage),
            latency_ms: Some(tracked.latency.as_secs_f64() * 1e3),
        }
    }
}

impl fmt::Debug for RoomViews<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RoomViews")
            .field("pods", &self.room.pods)
            .finish_non_exhaustive()
    }
}

/// Asks for the tumour's true shift (x, y, z) from its planned position at a device time, in
/// millimetres. The fourth value is the length of the shift.
fn truth(service: &Path, time: Duration, target_mm: [f64; 3]) -> Option<[f64; 4]> {
    let request = Request::ObjectsAt(time.as_nanos() as u64);
    let (reply, _) = ask_service(service, &request).ok()?;
    let objects = reply.scene?.objects;
    let patient = objects.iter().find_map(|object| object.patient)?;
    let shift = DVec3::from_array(patient.tumour_mm) - DVec3::from_array(target_mm);
    Some([shift.x, shift.y, shift.z, shift.length()])
}

fn held(beam: &Beam) -> Option<String> {
    match beam {
        Beam::On => None,
        Beam::Held(reason) => Some(reason.to_string()),
    }
}

fn surface(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Surface {
    Surface {
        vertices: vertices.iter().map(|v| v.as_vec3().to_array()).collect(),
        triangles: triangles.to_vec(),
    }
}
