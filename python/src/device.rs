//! An emulated device, in memory and served.

use crate::call::{Shared, left, pool, quiet, seconds, tell, watch};
use crate::documents::{Profile, Rig, Scene, to_json};
use crate::errors::raised;
use crate::results::{Stacked, faults_of, truth};
use phasmid::emulator::render::Backend;
use phasmid::link::{
    CameraNode, Notice, RecordingFile, ServeOptions, Serving as Served, Tcp, UsbServing,
};
use phasmid::protocol::service::ClockPace;
use phasmid::{DeviceBuilder, Error, Stop, Truth};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// An emulated device in memory.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Device {
    shared: Shared<phasmid::Device>,
    stop: Stop,
}

fn backend_of(name: &str) -> PyResult<Backend> {
    match name {
        "cpu" => Ok(Backend::Cpu),
        "gpu" => Ok(Backend::Gpu),
        "auto" => Ok(Backend::Auto),
        _ => Err(raised(Error::input(
            "backend",
            format!("{name:?}"),
            "\"cpu\", \"gpu\" or \"auto\"",
        ))),
    }
}

fn clock_of(name: &str) -> PyResult<ClockPace> {
    match name {
        "real" => Ok(ClockPace::Real),
        "fast" => Ok(ClockPace::Fast),
        "stepped" => Ok(ClockPace::Stepped),
        _ => Err(raised(Error::input(
            "clock",
            format!("{name:?}"),
            "\"real\", \"fast\" or \"stepped\"",
        ))),
    }
}

#[pymethods]
impl Device {
    #[new]
    #[pyo3(signature = (
        profile, scene, *, seed, backend, samples, time_samples, motion_tolerance, noise, exact_calibration, dialect, sequences,
        faults
    ))]
    #[allow(
        clippy::too_many_arguments,
        reason = "the settings of a builder, named in Python"
    )]
    fn new(
        py: Python<'_>,
        profile: &Profile,
        scene: &Scene,
        seed: u64,
        backend: &str,
        samples: u32,
        time_samples: u32,
        motion_tolerance: f64,
        noise: Option<bool>,
        exact_calibration: Option<bool>,
        dialect: Option<PathBuf>,
        sequences: Vec<PathBuf>,
        faults: Option<&str>,
    ) -> PyResult<Self> {
        let stop = Stop::default();
        let backend = backend_of(backend)?;
        let mut builder = DeviceBuilder::default()
            .profile(profile.value.clone())
            .scene(scene.value.clone())
            .seed(seed)
            .backend(backend)
            .samples(samples)
            .time_samples(time_samples)
            .motion_tolerance(motion_tolerance)
            .stop(stop.clone());
        if let Some(noise) = noise {
            builder = builder.noise(noise);
        }
        if let Some(exact) = exact_calibration {
            builder = builder.exact_calibration(exact);
        }
        if let Some(dialect) = dialect {
            builder = builder.dialect(dialect.to_string_lossy());
        }
        for sequence in sequences {
            builder = builder.sequence(sequence);
        }
        if let Some(faults) = faults {
            builder = builder.faults(faults_of(faults)?);
        }
        let device = quiet(py, &stop, || builder.build())?;
        let shared = match backend {
            Backend::Cpu => Shared::new("device", device),
            // A GPU driver does not work in a forked child.
            _ => Shared::at_home("device", device),
        };
        Ok(Self { shared, stop })
    }

    fn scan<'py>(
        &self,
        py: Python<'py>,
        sequence: Option<String>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let stop = self.stop.clone();
        let stacked = self
            .shared
            .long(py, &self.stop, tell(progress), |device, report| {
                let sequence = sequence.or_else(|| device.sequences().into_iter().next());
                let sequence = sequence.unwrap_or_default();
                Stacked::new(device.scan_with(&sequence, watch(&stop, report))?)
            })?;
        stacked.into_arguments(py)
    }

    fn truth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.truth_of(py, phasmid::Device::truth)
    }

    fn truth_at<'py>(&self, py: Python<'py>, time_s: f64) -> PyResult<Bound<'py, PyDict>> {
        let time = seconds("time_s", time_s)?;
        self.truth_of(py, |device| device.truth_at(time))
    }

    fn frame_truth<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyDict>> {
        self.truth_of(py, |device| device.frame_truth(index))
    }

    fn control(&self, py: Python<'_>, bytes: Vec<u8>) -> PyResult<Vec<u8>> {
        self.shared
            .quiet(py, &self.stop, |device| Ok(device.control(&bytes)))
    }

    fn sequences(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.with(py, |device| Ok(device.sequences()))
    }

    fn factory_calibration(&self, py: Python<'_>) -> PyResult<Rig> {
        // Its covariance is computed in parallel.
        self.shared.quiet(py, &self.stop, |device| {
            device.factory_calibration().map(Rig)
        })
    }

    fn rig(&self, py: Python<'_>) -> PyResult<Rig> {
        self.shared.with(py, |device| Ok(Rig(device.rig())))
    }

    fn time_s(&self, py: Python<'_>) -> PyResult<f64> {
        self.shared
            .with(py, |device| Ok(device.time().as_secs_f64()))
    }

    fn wait(&self, py: Python<'_>, time_s: f64) -> PyResult<()> {
        let time = seconds("time_s", time_s)?;
        self.shared.quiet(py, &self.stop, |device| {
            device.wait(time);
            Ok(())
        })
    }

    fn place(
        &self,
        py: Python<'_>,
        object: usize,
        position_mm: [f64; 3],
        rotation_deg: [f64; 3],
    ) -> PyResult<()> {
        self.shared.quiet(py, &self.stop, |device| {
            device.place(object, position_mm, rotation_deg)
        })
    }

    fn inject(&self, py: Python<'_>, fault: &str) -> PyResult<u64> {
        let fault = faults_of(fault)?;
        self.shared.with(py, |device| device.inject(fault))
    }

    fn clear_faults(&self, py: Python<'_>) -> PyResult<()> {
        self.shared.with(py, |device| {
            device.clear_faults();
            Ok(())
        })
    }

    fn struck(&self, py: Python<'_>) -> PyResult<String> {
        to_json(&self.shared.with(py, |device| Ok(device.struck()))?)
    }

    #[pyo3(signature = (*, run_dir, clock, tcp, camera, usb, record, notice))]
    #[allow(
        clippy::too_many_arguments,
        reason = "the fields of ServeOptions, named in Python"
    )]
    fn serve(
        &self,
        py: Python<'_>,
        run_dir: Option<PathBuf>,
        clock: &str,
        tcp: Option<u16>,
        camera: Option<PathBuf>,
        usb: bool,
        record: Option<(PathBuf, u64)>,
        notice: Option<Py<PyAny>>,
    ) -> PyResult<Serving> {
        let options = ServeOptions {
            run_dir,
            clock: clock_of(clock)?,
            tcp: tcp.map(|port| Tcp { port, token: None }),
            camera: match camera {
                None => CameraNode::None,
                Some(path) if path.as_os_str() == "auto" => CameraNode::Any,
                Some(path) => CameraNode::At(path),
            },
            usb: usb.then(UsbServing::default),
            record: record.map(|(path, started_unix_s)| RecordingFile {
                path,
                started_unix_s,
            }),
            notice: notice.map_or_else(Notice::default, |notice| {
                Notice::new(move |message| {
                    Python::attach(|py| {
                        if let Err(raised) = notice.call1(py, (message,)) {
                            raised.write_unraisable(py, None);
                        }
                    });
                })
            }),
            observer: None,
            // The device gets its own threads, because rayon's global pool does not work in a
            // forked child.
            threads: NonZeroUsize::new(pool(py)?.current_num_threads()),
        };
        let device = self.shared.take(py)?.ok_or_else(|| self.shared.closed())?;
        let served = left(py, move || device.serve(&options), drop)?;
        let endpoints = to_json(served.endpoints())?;
        Ok(Serving {
            served: Shared::at_home("served device", Guard(Some(served))),
            endpoints,
        })
    }

    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let device = self.shared.take(py)?;
        py.detach(|| drop(device));
        Ok(())
    }
}

impl Device {
    fn truth_of<'py>(
        &self,
        py: Python<'py>,
        of: impl FnOnce(&mut phasmid::Device) -> phasmid::Result<Truth> + Send,
    ) -> PyResult<Bound<'py, PyDict>> {
        truth(py, self.shared.quiet(py, &self.stop, of)?)
    }
}

/// A served device, which is dropped without the interpreter's lock.
struct Guard(Option<Served>);

impl Drop for Guard {
    fn drop(&mut self) {
        // Dropping the served device waits for a thread that may itself be waiting for the
        // interpreter, to pass on a notice.
        if let Some(served) = self.0.take() {
            let mut served = Some(served);
            let _ = Python::try_attach(|py| py.detach(|| drop(served.take())));
        }
    }
}

/// A device that is being served.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Serving {
    served: Shared<Guard>,
    endpoints: String,
}

#[pymethods]
impl Serving {
    fn endpoints(&self) -> &str {
        &self.endpoints
    }

    /// Ends the device; later calls do nothing.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        match self.served.take(py)?.and_then(|mut guard| guard.0.take()) {
            Some(served) => left(py, move || served.stop(), drop),
            None => Ok(()),
        }
    }
}
