//! The decoder.

use crate::arrays::{Frames, map, vectors};
use crate::call::quiet;
use crate::documents::{Manifest, Rig, to_json};
use crate::errors::raised;
use crate::results::{maps, maps_of};
use phasmid::decode::{Decoded, Held, Options, Summary};
use phasmid::geometry::{Cloud, NoiseModel, ply};
use phasmid::{Error, Stop};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Decodes frames of one sequence from one camera.
#[pyclass(frozen, module = "phasmid._phasmid")]
pub struct Decoder {
    decoder: phasmid::Decoder,
    /// Shared by all calls, so Ctrl-C in one thread also ends the calls of other threads.
    stop: Stop,
}

#[pymethods]
impl Decoder {
    #[new]
    #[pyo3(signature = (
        manifest, width, height, rig, *, keep_mixed, unwrap_spatial, min_modulation_dn, min_contrast,
        max_phase_sigma_rad, weighted, held, consistency, noise
    ))]
    #[allow(
        clippy::too_many_arguments,
        reason = "the fields of Options, named in Python"
    )]
    fn new(
        py: Python<'_>,
        manifest: &Manifest,
        width: usize,
        height: usize,
        rig: Option<&Rig>,
        keep_mixed: bool,
        unwrap_spatial: bool,
        min_modulation_dn: f32,
        min_contrast: f32,
        max_phase_sigma_rad: f32,
        weighted: bool,
        held: &str,
        consistency: bool,
        noise: Option<[f64; 4]>,
    ) -> PyResult<Self> {
        let held = match held {
            "off" => Held::Off,
            "state" => Held::State,
            "correct" => Held::Correct,
            "smooth" => Held::Smooth,
            _ => {
                let expected = "\"off\", \"state\", \"correct\" or \"smooth\"";
                return Err(raised(Error::input("held", format!("{held:?}"), expected)));
            }
        };
        let noise = noise.map(|[gain, read, black, saturation]| NoiseModel {
            gain_dn_per_e: gain,
            read_noise_dn: read,
            black_level_dn: black,
            saturation_dn: saturation,
        });
        let options = Options {
            keep_mixed,
            unwrap_spatial,
            min_modulation_dn,
            min_contrast,
            max_phase_sigma_rad,
            weighted,
            held,
            consistency,
            noise,
        };
        let stop = Stop::default();
        let decoder = quiet(py, &stop, || {
            phasmid::Decoder::new(&manifest.0, width, height, rig.map(|rig| &rig.0), options)
        })?;
        Ok(Self {
            decoder: decoder.with_stop(stop.clone()),
            stop,
        })
    }

    fn decode<'py>(
        &self,
        py: Python<'py>,
        frames: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let frames = Frames::of(frames)?;
        let views = frames.views()?;
        let decoded = quiet(py, &self.stop, || {
            let asked = self.stop.times();
            let mut decoded = Decoded::default();
            self.decoder.decode_views(&views, &mut decoded)?;
            // The stop was requested and reset while the decoder ran, so rows may be missing.
            match self.stop.times() == asked {
                true => Ok(decoded),
                false => Err(Error::Interrupted),
            }
        })?;
        maps(py, decoded)
    }

    /// Returns points, normals, intensities and standard deviations.
    fn cloud<'py>(
        &self,
        py: Python<'py>,
        decoding: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let cloud = self.cloud_of(py, decoding)?;
        let column = |values: Option<Vec<f32>>| {
            let values = values.unwrap_or_default();
            map(py, [values.len(), 1], values)?.call_method0("ravel")
        };
        let arguments = (
            vectors(py, cloud.points)?,
            vectors(py, cloud.normals.unwrap_or_default())?,
            column(cloud.intensity)?,
            column(cloud.sigma_mm)?,
        );
        Ok(arguments.into_pyobject(py)?.into_any())
    }

    /// Writes the points as a PLY file.
    fn write_ply(
        &self,
        py: Python<'_>,
        decoding: &Bound<'_, PyAny>,
        path: PathBuf,
    ) -> PyResult<()> {
        let cloud = self.cloud_of(py, decoding)?;
        quiet(py, &Stop::default(), || ply::write_cloud(&path, &cloud))
    }

    /// Returns figures of a decoding, as JSON.
    fn summary(&self, py: Python<'_>, decoding: &Bound<'_, PyAny>) -> PyResult<String> {
        let maps = maps_of(decoding)?;
        let summary = quiet(py, &Stop::default(), || {
            Ok(Summary::new(&self.decoder, &maps))
        })?;
        to_json(&summary)
    }
}

impl Decoder {
    fn cloud_of(&self, py: Python<'_>, decoding: &Bound<'_, PyAny>) -> PyResult<Cloud> {
        let maps = maps_of(decoding)?;
        quiet(py, &Stop::default(), || Ok(self.decoder.cloud(&maps)))
    }
}

/// Returns the names of the verdicts, by number.
#[pyfunction]
pub fn verdicts() -> Vec<&'static str> {
    let all = phasmid::decode::Verdict::ALL.into_iter();
    all.map(phasmid::decode::Verdict::name).collect()
}
