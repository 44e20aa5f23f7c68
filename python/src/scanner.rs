//! A scanner at its addresses, emulated or physical.

use crate::call::{OwnPool, Shared, left, tell};
use crate::documents::{Manifest, Rig};
use crate::errors::raised;
use crate::results::{Stacked, truth};
use phasmid::host::Progress;
use phasmid::{Error, ScanOptions, Stop};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

/// For messages.
const NAME: &str = "scanner";

/// A scanner with an open camera and control port.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Scanner {
    pub shared: Shared<phasmid::Scanner>,
    pool: OwnPool,
}

#[pymethods]
impl Scanner {
    #[staticmethod]
    #[pyo3(signature = (
        camera, control, *, sequence, manifest, dialect, calibration, reply_timeout_s, frame_timeout_s
    ))]
    #[allow(
        clippy::too_many_arguments,
        reason = "the fields of ScanOptions, named in Python"
    )]
    fn connect(
        py: Python<'_>,
        camera: PathBuf,
        control: PathBuf,
        sequence: Option<String>,
        manifest: Option<&Manifest>,
        dialect: Option<PathBuf>,
        calibration: Option<&Rig>,
        reply_timeout_s: f64,
        frame_timeout_s: f64,
    ) -> PyResult<Self> {
        let timeout = |field: &str, seconds: f64| {
            Duration::try_from_secs_f64(seconds)
                .map_err(|_| raised(Error::input(field, seconds, "seconds, 0 or more")))
        };
        let options = ScanOptions {
            sequence,
            manifest: manifest.map(|manifest| manifest.0.clone()),
            dialect: dialect.map(|dialect| dialect.to_string_lossy().into_owned()),
            calibration: calibration.map(|rig| rig.0),
            reply_timeout: timeout("reply_timeout_s", reply_timeout_s)?,
            frame_timeout: timeout("frame_timeout_s", frame_timeout_s)?,
            ..ScanOptions::default()
        };
        let camera = camera.to_string_lossy().into_owned();
        let connect = move || phasmid::Scanner::connect(&camera, &control, options);
        let pool = OwnPool::new()?;
        let scanner = left(py, connect)?;
        Ok(Self {
            shared: Shared::new(NAME, scanner),
            pool,
        })
    }

    fn scan<'py>(
        &self,
        py: Python<'py>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let stop = Stop::default();
        let pool = self.pool.get(NAME)?;
        let stacked = self
            .shared
            .long_on(pool, py, &stop, tell(progress), |scanner, report| {
                let capture = scanner.scan_with(|progress| {
                    if let Progress::Frame { done, of } = progress {
                        report((done, of));
                    }
                    match stop.is_asked() {
                        true => ControlFlow::Break(()),
                        false => ControlFlow::Continue(()),
                    }
                })?;
                Stacked::new(capture)
            })?;
        stacked.into_arguments(py)
    }

    fn select(&self, py: Python<'_>, sequence: String) -> PyResult<()> {
        self.shared.with(py, |scanner| {
            scanner.select(sequence);
            Ok(())
        })
    }

    fn selected(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let none = |_: Python<'_>, ()| Ok(());
        let stop = Stop::default();
        self.shared
            .long_on(self.pool.get(NAME)?, py, &stop, none, |scanner, _| {
                scanner.selected()
            })
    }

    fn truth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let none = |_: Python<'_>, ()| Ok(());
        let stop = Stop::default();
        truth(
            py,
            self.shared
                .long_on(self.pool.get(NAME)?, py, &stop, none, |scanner, _| {
                    scanner.truth()
                })?,
        )
    }

    /// Closes the ports; later calls do nothing.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        match self.shared.take(py)? {
            Some(scanner) => left(py, move || scanner.finish()),
            None => Ok(()),
        }
    }
}
