//! Answers of a device to requests on its service channel.

use super::render_thread::TruthJob;
use super::server::Server;
use super::service::{Answer, Call};
use super::shared_scene::SharedScene;
use super::timeline::{Stepped, UnderWay};
use crate::{State, Truth};
use phasmid_core::error::Result;
use phasmid_core::source::Setting;
use phasmid_protocol::faults::Kind;
use phasmid_protocol::service::{
    Action, DeviceAbout, Every, FaultsAbout, Item, MAX_STRUCK, Reply, Request, StandingFault, Step,
    TermAbout, Which,
};
use phasmid_render::{Decision, Term};
use std::time::Duration;
use tokio::sync::oneshot;

/// Bytes that were written to a port before a step was requested may still be in the kernel; it
/// delivers them within this time.
const IN_TRANSIT: Duration = Duration::from_millis(2);

type Sender = oneshot::Sender<Answer>;
/// Receives the ground truth when the render thread has computed it.
type Truthful = oneshot::Receiver<Result<Truth>>;

impl Server {
    /// Executes a request of a service client; the answer may come later.
    pub(super) fn serve_call(&mut self, (request, reply): Call, now_ns: u64) {
        let answer = match request {
            Request::Get(Item::Truth) => return self.truth(None, reply),
            Request::TruthAt(time_ns) => return self.truth(Some(time_ns), reply),
            Request::TruthOfFrame(id) => match self.truth_of_frame(id) {
                Ok((job, about, truth)) => {
                    self.render_thread.truth(job);
                    return self.answer_truth(truth, about, reply);
                }
                Err(why) => Reply::refusal(why),
            },
            Request::Place(placement) => match self.shared_scene.place(placement) {
                Ok(before) => {
                    let ended = move |scene: &SharedScene, followed: bool| {
                        if !followed {
                            let _ = scene.place(before);
                        }
                    };
                    return self.answer_change(ended, reply);
                }
                Err(why) => Reply::refusal(why),
            },
            Request::Set(field) => match self.set(&field) {
                Ok(()) => return self.answer_change(SharedScene::settle, reply),
                Err(why) => Reply::refusal(why),
            },
            Request::Get(Item::Plan) => return self.plan(None, reply),
            Request::Term(choice) => match Term::named(&choice.term) {
                Some(term) => return self.plan(Some((term, choice.included)), reply),
                None => {
                    let names: Vec<_> = Term::ALL.iter().map(Term::to_string).collect();
                    let (found, known) = (&choice.term, names.join(", "));
                    Reply::refusal(format!("term.term: {found:?}; expected one of {known}"))
                }
            },
            Request::Get(Item::Fields) => Reply {
                fields: serde_json::to_value(self.shared_scene.scene()).ok(),
                ..Reply::default()
            },
            Request::Clock(step) => return self.step(step, reply),
            Request::Do(Action::Trigger) => {
                self.machine.firmware_mut().external_trigger(now_ns);
                self.machine.advance(now_ns);
                Reply::default()
            }
            Request::Get(Item::Clock) => Reply {
                clock: Some(self.seat.timeline().about()),
                ..Reply::default()
            },
            Request::Get(Item::Objects) => self.objects(now_ns),
            Request::ObjectsAt(time_ns) => self.objects(time_ns),
            Request::Get(Item::Faults) => Reply {
                faults: Some(self.faults()),
                ..Reply::default()
            },
            Request::Fault(fault) => match self.machine.faults_mut().add(*fault) {
                Ok(id) => Reply {
                    fault: Some(id),
                    ..Reply::default()
                },
                Err(flaw) => Reply::refusal(format!("fault.{flaw}")),
            },
            Request::ClearFaults(which) => self.clear_faults(which),
            Request::Get(Item::Device) => Reply {
                device: Some(self.about()),
                ..Reply::default()
            },
            Request::Get(Item::Sequence) => {
                let firmware = self.machine.firmware();
                Reply {
                    sequence: Some(firmware.selected()),
                    ..Reply::default()
                }
            }
            Request::Get(Item::Calibration) => {
                match self.machine.firmware().reported_calibration() {
                    Ok(rig) => Reply {
                        calibration: Some(rig.to_toml()),
                        ..Reply::default()
                    },
                    Err(why) => Reply::refusal(why),
                }
            }
        };
        // Ignore an error: the client may have disconnected.
        let _ = reply.send((answer, Vec::new()));
    }

    fn objects(&mut self, time_ns: u64) -> Reply {
        self.follow_others();
        Reply {
            scene: self.shared_scene.objects(time_ns, self.version, self.rig),
            ..Reply::default()
        }
    }

    fn truth(&mut self, time_ns: Option<u64>, reply: Sender) {
        self.follow_others();
        let (sender, truth) = oneshot::channel();
        self.render_thread.truth(TruthJob {
            sequence: self.machine.firmware().selected_sequence(),
            time_ns,
            back: (Vec::new(), Vec::new()),
            reply: sender,
        });
        self.answer_truth(truth, Reply::default(), reply);
    }

    /// Returns the render job for the truth of a frame, the fields of the reply that need no
    /// rendering, and the receiver of the truth.
    fn truth_of_frame(&mut self, id: u64) -> Result<(TruthJob, Reply, Truthful), String> {
        self.follow_others();
        let taken = self.history.find(id)?;
        let time_ns = taken.middle_ns();
        let scene = self.shared_scene.objects(time_ns, taken.version, self.rig);
        let then = self.shared_scene.back_to(taken.version);
        let (Some(scene), Some(then)) = (scene, then) else {
            let why = format!(
                "truth_of_frame: {id}: the object positions of this frame are no longer stored"
            );
            return Err(why + "; expected a frame since the last 4096 changes of position");
        };
        let now = self.shared_scene.now(&then);
        let struck = self.machine.faults().struck();
        let faults = struck.filter(|s| s.frame == Some(id)).cloned().collect();
        let (sender, truth) = oneshot::channel();
        let job = TruthJob {
            // Signal levels depend on settings that may have changed since the exposure, so the
            // truth omits them.
            sequence: Vec::new(),
            time_ns: Some(time_ns),
            back: (then, now),
            reply: sender,
        };
        let about = Reply {
            frame: Some(taken.clone().about(scene, faults)),
            ..Reply::default()
        };
        Ok((job, about, truth))
    }

    /// Replies once the truth has been computed; `about` holds the fields of the reply that are
    /// already known.
    fn answer_truth(&self, truth: Truthful, about: Reply, reply: Sender) {
        let render_us = self.render_thread.render_us();
        tokio::spawn(async move {
            let answer = match truth.await {
                Ok(Ok(truth)) => {
                    let frame = about.frame;
                    let maps = match frame {
                        Some(_) => truth.to_maps_of_geometry(),
                        None => truth.to_maps(),
                    };
                    let (maps, payload) = maps.encode();
                    let reply = Reply {
                        render_us,
                        frame,
                        ..maps
                    };
                    (reply, payload)
                }
                Ok(Err(why)) => (Reply::refusal(why), Vec::new()),
                Err(_) => (Reply::refusal("the device is shutting down"), Vec::new()),
            };
            // Ignore an error: the client may have disconnected.
            let _ = reply.send(answer);
        });
    }

    /// Sets a field of the scene.
    fn set(&self, field: &str) -> Result<()> {
        let setting: Setting = field.parse()?;
        self.shared_scene.set(setting.given_by("set"))
    }

    /// Replies with the plan. If `forced` names a term, the term is included or excluded first.
    fn plan(&self, forced: Option<(Term, bool)>, reply: Sender) {
        let (sender, decided) = oneshot::channel();
        self.render_thread.plan(forced, sender);
        let render_us = self.render_thread.render_us();
        tokio::spawn(async move {
            let answer = match decided.await {
                Ok(decisions) => Reply {
                    render_us,
                    plan: decisions.into_iter().map(term_about).collect(),
                    ..Reply::default()
                },
                Err(_) => Reply::refusal("the device is shutting down"),
            };
            // Ignore an error: the client may have disconnected.
            let _ = reply.send((answer, Vec::new()));
        });
    }

    /// Replies once the optics have applied or rejected a change of the scene. Before the reply,
    /// calls `ended` with `true` if the optics applied the change, or with `false` if they rejected
    /// it, so that the caller can undo it.
    fn answer_change(
        &mut self,
        ended: impl FnOnce(&SharedScene, bool) + Send + 'static,
        reply: Sender,
    ) {
        let placed = self.follow();
        let render_us = self.render_thread.render_us();
        let shared_scene = self.shared_scene.clone();
        tokio::spawn(async move {
            let outcome = match placed {
                Some(placed) => placed.await,
                None => Ok(Ok(())),
            };
            ended(&shared_scene, !matches!(outcome, Ok(Err(_))));
            let answer = match outcome {
                Ok(Ok(())) => Reply {
                    render_us,
                    ..Reply::default()
                },
                Ok(Err(why)) => Reply::refusal(why),
                Err(_) => Reply::refusal("the device is shutting down"),
            };
            // Ignore an error: the client may have disconnected.
            let _ = reply.send((answer, Vec::new()));
        });
    }

    /// Advances stepped time and replies when the step is complete. If the client disconnects before
    /// that, its step is cancelled.
    fn step(&self, step: Step, mut reply: Sender) {
        let timeline = self.seat.timeline().clone();
        tokio::spawn(async move {
            let stepped = match step {
                Step::Stop => timeline.stop().map(|()| None),
                Step::Pace(pace) => timeline.set_pace(pace).map(|()| None),
                Step::StepNs(ns) => {
                    tokio::time::sleep(IN_TRANSIT).await;
                    timeline.step(ns).map(Some)
                }
                Step::RunUntilNs(ns) => {
                    tokio::time::sleep(IN_TRANSIT).await;
                    timeline.run_until(ns).map(Some)
                }
            };
            let now = || Reply {
                clock: Some(timeline.about()),
                ..Reply::default()
            };
            let answer = match stepped {
                Ok(None) => now(),
                Ok(Some(UnderWay { number, ended })) => tokio::select! {
                    ended = ended => match ended {
                        Ok(Stepped::Done(_)) => now(),
                        Ok(Stepped::CalledOff(now_ns)) => {
                            Reply::refusal(format!("clock: cancelled at {now_ns} ns"))
                        }
                        Err(_) => Reply::refusal("the device is shutting down"),
                    },
                    () = reply.closed() => return timeline.give_up(number),
                },
                Err(why) => Reply::refusal(why.to_string()),
            };
            // Ignore an error: the client may have disconnected.
            let _ = reply.send((answer, Vec::new()));
        });
    }

    fn clear_faults(&mut self, which: Which) -> Reply {
        let faults = self.machine.faults_mut();
        match which {
            Which::Every(Every::All) => faults.clear(),
            Which::One(id) if faults.remove(id) => {}
            Which::One(id) => {
                let numbers: Vec<_> = faults.standing().map(|f| f.id.to_string()).collect();
                let allowed = match numbers.is_empty() {
                    true => "none: no fault is active".to_owned(),
                    false => numbers.join(", "),
                };
                return Reply::refusal(format!("clear_faults: {id}; expected {allowed}"));
            }
        }
        Reply::default()
    }

    fn faults(&self) -> FaultsAbout {
        let faults = self.machine.faults();
        let latest = faults.struck().rev().take(MAX_STRUCK).cloned();
        let mut struck: Vec<_> = latest.collect();
        struck.reverse();
        FaultsAbout {
            kinds: Kind::ALL.iter().map(|kind| kind.name.to_owned()).collect(),
            standing: faults
                .standing()
                .map(|standing| StandingFault {
                    id: standing.id,
                    struck: standing.struck,
                    fault: standing.fault.clone(),
                })
                .collect(),
            struck_in_all: faults.struck_in_all(),
            struck,
        }
    }

    fn about(&self) -> DeviceAbout {
        let firmware = self.machine.firmware();
        let state = match firmware.state() {
            State::Idle => "idle",
            State::Free { .. } => "free",
            State::Armed { .. } => "armed",
            State::Running { .. } => "running",
        };
        DeviceAbout {
            name: self.name.clone(),
            state: state.to_owned(),
            frames: firmware.next_id(),
            rendered: self.render_thread.rendered(),
            missed_triggers: firmware.missed_triggers(),
            faults_struck: self.machine.faults().struck_in_all(),
            in_flight: firmware.in_flight(),
            backlog: self.render_thread.backlog() as u64,
            camera_clients: self.camera.readers() as u64,
            camera_bytes: self.camera.waiting() as u64,
            service_clients: self.service.clients() as u64,
            bytes_in: self.bytes.0,
            bytes_out: self.bytes.1,
            history: self.history.len() as u64,
        }
    }
}

fn term_about(decision: Decision) -> TermAbout {
    TermAbout {
        pass: decision.pass.to_string(),
        term: decision.term.to_string(),
        included: decision.included,
        why: decision.why.to_owned(),
    }
}
