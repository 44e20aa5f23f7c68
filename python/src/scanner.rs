//! A scanner at its addresses, emulated or physical.

use crate::call::{Shared, left, long_on, new_pool, seconds, tell, watch};
use crate::documents::{Manifest, Rig};
use crate::results::{Stacked, truth};
use phasmid::{Result, ScanOptions, Stop};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;
use std::path::PathBuf;

/// A scanner with an open camera and control port.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Scanner(pub Shared<Connected>);

/// A scanner and the threads that wait for it.
pub struct Connected {
    pub scanner: phasmid::Scanner,
    pool: ThreadPool,
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
        let options = ScanOptions {
            sequence,
            manifest: manifest.map(|manifest| manifest.0.clone()),
            dialect: dialect.map(|dialect| dialect.to_string_lossy().into_owned()),
            calibration: calibration.map(|rig| rig.0),
            reply_timeout: seconds("reply_timeout_s", reply_timeout_s)?,
            frame_timeout: seconds("frame_timeout_s", frame_timeout_s)?,
            ..ScanOptions::default()
        };
        let camera = camera.to_string_lossy().into_owned();
        let connect = move || phasmid::Scanner::connect(&camera, &control, options);
        let pool = new_pool()?;
        // If connecting is interrupted, finish the scanner, so that a free-running camera resumes.
        let scanner = left(py, connect, |scanner| drop(scanner.finish()))?;
        Ok(Self(Shared::at_home(
            "scanner",
            Connected { scanner, pool },
        )))
    }

    fn scan<'py>(
        &self,
        py: Python<'py>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let stop = Stop::default();
        let stacked = self.long(py, &stop, tell(progress), |scanner, report| {
            Stacked::new(scanner.scan_with(watch(&stop, report))?)
        })?;
        stacked.into_arguments(py)
    }

    fn select(&self, py: Python<'_>, sequence: String) -> PyResult<()> {
        self.0.with(py, |connected| {
            connected.scanner.select(sequence);
            Ok(())
        })
    }

    fn selected(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.quiet(py, phasmid::Scanner::selected)
    }

    fn truth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        truth(py, self.quiet(py, phasmid::Scanner::truth)?)
    }

    /// Closes the ports; later calls do nothing.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        match self.0.take(py)? {
            Some(connected) => left(py, move || connected.scanner.finish(), drop),
            None => Ok(()),
        }
    }
}

impl Scanner {
    fn long<T: Send, P: Send>(
        &self,
        py: Python<'_>,
        stop: &Stop,
        tell: impl FnMut(Python<'_>, P) -> PyResult<()> + Send,
        work: impl FnOnce(&mut phasmid::Scanner, &dyn Fn(P)) -> Result<T> + Send,
    ) -> PyResult<T> {
        let mut locked = self.0.lock(py)?;
        let Connected { scanner, pool } = locked.as_mut().ok_or_else(|| self.0.closed())?;
        long_on(pool, py, stop, tell, |report| work(scanner, report))
    }

    fn quiet<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut phasmid::Scanner) -> Result<T> + Send,
    ) -> PyResult<T> {
        let none = |_: Python<'_>, ()| Ok(());
        self.long(py, &Stop::default(), none, |scanner, _| work(scanner))
    }
}
