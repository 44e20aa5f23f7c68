//! Converts errors to the Python exceptions defined in `phasmid/_errors.py`.

use phasmid::Error;
use pyo3::prelude::*;
use pyo3::types::PyList;
use std::error::Error as _;

/// Returns the exception for an error.
pub fn raised(error: Error) -> PyErr {
    Python::attach(|py| match exception(py, error) {
        Ok(exception) => PyErr::from_value(exception),
        Err(failed) => failed,
    })
}

fn exception(py: Python<'_>, error: Error) -> PyResult<Bound<'_, PyAny>> {
    let classes = py.import("phasmid._errors")?;
    let class = |name: &str| classes.getattr(name);
    match error {
        Error::Input {
            place,
            found,
            expected,
        } => class("InputError")?.call1((place, found, expected)),
        Error::Io { place, source } => {
            let (number, message) = (source.raw_os_error(), source.to_string());
            class("OperatingSystemError")?.call1((place, message, number))
        }
        Error::Several(errors) => {
            let each: PyResult<Vec<_>> = errors.into_iter().map(|e| exception(py, e)).collect();
            class("SeveralErrors")?.call1((PyList::new(py, each?)?,))
        }
        Error::Interrupted => class("Interrupted")?.call0(),
        Error::Rejected { .. } => {
            let reason = error.source().map(ToString::to_string);
            class("RejectedError")?.call1((error.to_string(), reason))
        }
        Error::Device(message) => class("DeviceError")?.call1((message,)),
        other => class("Error")?.call1((other.to_string(),)),
    }
}
