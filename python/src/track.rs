//! Tracking of a patient by the pods of a treatment room.

use crate::call::{Shared, flow, left, long_on, new_pool, quiet, seconds};
use crate::documents::to_json;
use crate::scanner::Scanner;
use phasmid::patient::phantom::{Patient, Phantom};
use phasmid::profile::RigPlace;
use phasmid::track::{Beam, HoldRules, Planned};
use phasmid::{Stop, TrackOptions, TrackProgress, Tracked};
use pyo3::prelude::*;
use serde_json::json;
use std::path::PathBuf;

/// A patient as planned.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Planning(Planned);

#[pymethods]
impl Planning {
    #[staticmethod]
    fn load(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        quiet(py, &Stop::default(), || Planned::load(&folder)).map(Self)
    }

    #[getter]
    fn tumour_mm(&self) -> [f64; 3] {
        self.0.tumour_mm().into()
    }
}

/// Writes the planning folder of a generated patient.
#[pyfunction]
pub fn export_planning(
    py: Python<'_>,
    patient: PathBuf,
    folder: PathBuf,
    spacing_mm: f64,
    ct: bool,
    force: bool,
) -> PyResult<()> {
    quiet(py, &Stop::default(), || {
        let patient = Patient::load(&patient.to_string_lossy())?;
        Phantom::new(&patient).export_planning(&folder, spacing_mm, ct, force)
    })
}

/// A scanner at a known place in the treatment room.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Pod(Shared<phasmid::Pod>);

#[pymethods]
impl Pod {
    #[new]
    fn new(
        py: Python<'_>,
        name: &str,
        scanner: &Scanner,
        position_mm: [f64; 3],
        rotation_deg: [f64; 3],
    ) -> PyResult<Self> {
        let taken = scanner.0.take(py)?.ok_or_else(|| scanner.0.closed())?;
        let place = RigPlace {
            position_mm,
            rotation_deg,
        };
        let pod = phasmid::Pod::new(name, taken.scanner, place);
        Ok(Self(Shared::at_home("pod", pod)))
    }

    /// Closes the ports; later calls do nothing.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        match self.0.take(py)? {
            Some(pod) => left(py, move || pod.finish(), drop),
            None => Ok(()),
        }
    }
}

fn scan_json(tracked: &Tracked) -> serde_json::Value {
    let skin = tracked.skin.as_ref().map(|skin| {
        json!({ "shift_mm": skin.shift_mm, "shift_sd_mm": skin.shift_sd_mm,
            "rotation_deg": skin.rotation_deg, "rotation_sd_deg": skin.rotation_sd_deg })
    });
    let tumour = tracked.tumour.as_ref().map(|tumour| {
        json!({ "position_mm": tumour.position_mm, "sd_mm": tumour.sd_mm, "off_mm": tumour.off_mm,
            "off_sd_mm": tumour.off_sd_mm, "modes": tumour.modes, "modes_sd": tumour.modes_sd,
            "rms_mm": tumour.rms_mm, "coverage": tumour.coverage })
    });
    json!({
        "scan": tracked.scan,
        "time_s": tracked.time.as_secs_f64(),
        "middle_s": tracked.middle.map(|time| time.as_secs_f64()),
        "points": tracked.points,
        "skin": skin,
        "tumour": tumour,
        "held": held(&tracked.beam),
        "warnings": tracked.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "decoding_s": tracked.decoding.as_secs_f64(),
        "latency_s": tracked.latency.as_secs_f64(),
    })
}

/// Returns why the beam is held; `None` if it is on.
fn held(beam: &Beam) -> Option<String> {
    match beam {
        Beam::On => None,
        Beam::Held(why) => Some(why.to_string()),
    }
}

/// Tracks with pods, and passes each result to `tell` as JSON, until `tell` returns true.
#[pyfunction]
#[pyo3(signature = (
    pods, planning, tell, *, tolerance_mm, scans, duration_s, deviations, enter, settle_s, stale_s
))]
#[allow(
    clippy::too_many_arguments,
    reason = "the fields of TrackOptions, named in Python"
)]
pub fn track(
    py: Python<'_>,
    pods: Vec<Bound<'_, Pod>>,
    planning: &Planning,
    tell: Py<PyAny>,
    tolerance_mm: f64,
    scans: Option<u64>,
    duration_s: Option<f64>,
    deviations: f64,
    enter: f64,
    settle_s: f64,
    stale_s: f64,
) -> PyResult<()> {
    let nanoseconds = |field: &str, time_s: f64| {
        Ok::<_, PyErr>(u64::try_from(seconds(field, time_s)?.as_nanos()).unwrap_or(u64::MAX))
    };
    let options = TrackOptions {
        tolerance_mm,
        scans,
        duration: duration_s.map(|s| seconds("duration_s", s)).transpose()?,
        rules: HoldRules {
            deviations,
            enter,
            settle_ns: nanoseconds("settle_s", settle_s)?,
            stale_ns: nanoseconds("stale_s", stale_s)?,
        },
    };
    let pool = new_pool()?;
    let mut taken = Vec::new();
    for pod in &pods {
        let pod = &pod.get().0;
        match pod.take(py) {
            Ok(Some(pod)) => taken.push(pod),
            missing => {
                put_back(py, &pods, taken)?;
                return Err(missing.err().unwrap_or_else(|| pod.closed()));
            }
        }
    }
    let stop = Stop::default();
    let told = |py: Python<'_>, json: serde_json::Value| {
        if tell.call1(py, (to_json(&json)?,))?.is_truthy(py)? {
            stop.ask();
        }
        Ok(())
    };
    let tracked = long_on(&pool, py, &stop, told, |report| {
        phasmid::track(&mut taken, &planning.0, &options, |progress| {
            match progress {
                TrackProgress::Scan(tracked) => report(scan_json(tracked)),
                TrackProgress::Overdue { scan, beam } => {
                    report(json!({ "overdue": scan, "held": held(beam) }));
                }
                TrackProgress::Doubtful { pod, why } => {
                    report(json!({ "pod": pod, "doubtful": why.to_string() }));
                }
                _ => {}
            }
            flow(&stop)
        })
    });
    tracked.and(put_back(py, &pods, taken))
}

/// Puts the pods of a call back into their Python objects, for the next call.
fn put_back(py: Python<'_>, pods: &[Bound<'_, Pod>], taken: Vec<phasmid::Pod>) -> PyResult<()> {
    let pairs = pods.iter().zip(taken);
    let each = pairs.map(|(pod, scanner)| pod.get().0.put(py, scanner));
    // Put all of them back, even if one fails.
    each.fold(Ok(()), PyResult::and)
}
