//! Converts captures, maps and truths to the fields of Python classes and back.

use crate::arrays::{Frames, Stack, map, map_of, vector_map, vector_map_of};
use crate::documents::{Manifest, Rig, from_json, to_json};
use crate::errors::raised;
use phasmid::decode::{AxisMap, Decoded, Verdict};
use phasmid::{Capture, Error, FrameInfo, Truth};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Identity and times of a frame, as in [`FrameInfo`].
type Info = (u64, Option<u32>, u64, u64);

/// A capture whose images lie in one block.
pub struct Stacked {
    idn: String,
    manifest: Manifest,
    calibration: Option<Rig>,
    frames: Stack,
    info: Vec<Info>,
}

impl Stacked {
    /// Copies the images of a capture into one block.
    ///
    /// # Errors
    /// Returns an error if the images differ in size.
    pub fn new(capture: Capture) -> phasmid::Result<Self> {
        Ok(Self {
            frames: Stack::new(&capture.images)?,
            idn: capture.idn,
            manifest: Manifest(capture.manifest),
            calibration: capture.calibration.map(Rig),
            info: capture
                .frames
                .iter()
                .map(|f| {
                    (
                        f.id,
                        f.pattern_index,
                        f.exposure_start_ns,
                        f.exposure_end_ns,
                    )
                })
                .collect(),
        })
    }

    /// Returns the arguments of Python's `Capture`.
    pub fn into_arguments(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let manifest = Py::new(py, self.manifest)?;
        let rig = self.calibration.map(|rig| Py::new(py, rig)).transpose()?;
        let frames = self.frames.into_array(py)?;
        let arguments = (frames, manifest, rig, self.idn, self.info);
        Ok(arguments.into_pyobject(py)?.into_any())
    }
}

/// Returns a capture from Python's `Capture`, with a copy of the frames.
pub fn capture_of(capture: &Bound<'_, PyAny>) -> PyResult<Capture> {
    let manifest = capture.getattr("manifest")?.getattr("_inner")?;
    let rig = capture.getattr("calibration")?;
    let calibration = match rig.is_none() {
        true => None,
        false => Some(rig.getattr("_inner")?.cast::<Rig>()?.get().0),
    };
    let info: Vec<Info> = capture.getattr("info")?.extract()?;
    let info = info
        .into_iter()
        .map(|(id, pattern_index, start, end)| FrameInfo {
            id,
            pattern_index,
            exposure_start_ns: start,
            exposure_end_ns: end,
        });
    Ok(Capture {
        idn: capture.getattr("idn")?.extract()?,
        manifest: manifest.cast::<Manifest>()?.get().0.clone(),
        calibration,
        images: Frames::of(&capture.getattr("frames")?)?.images()?,
        frames: info.collect(),
    })
}

fn axis<'py>(
    py: Python<'py>,
    size: [usize; 2],
    axis: Option<AxisMap>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(axis) = axis else {
        return Ok(None);
    };
    let sampling = match axis.sampling.is_empty() {
        true => None,
        false => Some(map(py, size, axis.sampling)?),
    };
    // A verdict is one byte, so the compiler converts the vector in place.
    let verdict: Vec<u8> = axis
        .verdict
        .into_iter()
        .map(|verdict| verdict as u8)
        .collect();
    let arguments = (
        map(py, size, axis.coordinate)?,
        map(py, size, axis.sigma)?,
        map(py, size, verdict)?,
        sampling,
        axis.wrapped_px,
    );
    Ok(Some(arguments.into_pyobject(py)?.into_any()))
}

/// Returns the maps of Python's `Decoding`, without copying them.
pub fn maps(py: Python<'_>, maps: Decoded) -> PyResult<Bound<'_, PyAny>> {
    let size = [maps.height, maps.width];
    let some = |values: Vec<f32>| match values.is_empty() {
        true => Ok(None),
        false => map(py, size, values).map(Some),
    };
    let noise = maps.noise.map(|noise| {
        (
            noise.gain_dn_per_e,
            noise.read_noise_dn,
            noise.black_level_dn,
            noise.saturation_dn,
        )
    });
    let arguments = (
        axis(py, size, maps.x)?,
        axis(py, size, maps.y)?,
        map(py, size, maps.modulation)?,
        map(py, size, maps.intensity)?,
        some(maps.depth)?,
        some(maps.depth_sigma)?,
        noise,
        maps.notes,
    );
    Ok(arguments.into_pyobject(py)?.into_any())
}

fn axis_of(owner: &Bound<'_, PyAny>, name: &str, size: [usize; 2]) -> PyResult<Option<AxisMap>> {
    let axis = owner.getattr(name)?;
    if axis.is_none() {
        return Ok(None);
    }
    let verdicts: Vec<u8> = map_of(&axis, "verdict", size)?;
    let verdict = verdicts.into_iter().map(|verdict| {
        let known = Verdict::ALL.get(usize::from(verdict));
        known.copied().ok_or_else(|| {
            let expected = format!("0 to {}", Verdict::ALL.len() - 1);
            raised(Error::input(format!("{name}.verdict"), verdict, expected))
        })
    });
    Ok(Some(AxisMap {
        coordinate: map_of(&axis, "coordinate", size)?,
        sigma: map_of(&axis, "sigma", size)?,
        sampling: match axis.getattr("sampling")?.is_none() {
            true => Vec::new(),
            false => map_of(&axis, "sampling", size)?,
        },
        verdict: verdict.collect::<PyResult<_>>()?,
        wrapped_px: axis.getattr("wrapped_px")?.extract()?,
        ..AxisMap::default()
    }))
}

/// Returns a copy of the maps of Python's `Decoding`.
pub fn maps_of(decoding: &Bound<'_, PyAny>) -> PyResult<Decoded> {
    let (height, width): (usize, usize) =
        decoding.getattr("intensity")?.getattr("shape")?.extract()?;
    let size = [height, width];
    let some = |name: &str| match decoding.getattr(name)?.is_none() {
        true => Ok(Vec::new()),
        false => map_of(decoding, name, size),
    };
    Ok(Decoded {
        width,
        height,
        x: axis_of(decoding, "x", size)?,
        y: axis_of(decoding, "y", size)?,
        modulation: map_of(decoding, "modulation", size)?,
        intensity: map_of(decoding, "intensity", size)?,
        depth: some("depth")?,
        depth_sigma: some("depth_sigma")?,
        noise: None,
        notes: decoding.getattr("notes")?.extract()?,
        ..Decoded::default()
    })
}

/// Returns the fields of Python's `Truth`, without copying them.
pub fn truth(py: Python<'_>, truth: Truth) -> PyResult<Bound<'_, PyDict>> {
    let size = [truth.height as usize, truth.width as usize];
    let fields = PyDict::new(py);
    for (name, values) in [
        ("depth_mm", truth.depth_mm),
        ("projector_x", truth.projector_x),
        ("projector_y", truth.projector_y),
        ("albedo", truth.albedo),
        ("irradiance_w_m2", truth.irradiance_w_m2),
        ("mean_dn", truth.mean_dn),
        ("modulation_dn", truth.modulation_dn),
        ("noise_dn", truth.noise_dn),
    ] {
        fields.set_item(name, map(py, size, values)?)?;
    }
    fields.set_item("point_mm", vector_map(py, size, truth.point_mm)?)?;
    fields.set_item("normal", vector_map(py, size, truth.normal)?)?;
    fields.set_item("object", map(py, size, truth.object)?)?;
    fields.set_item("flags", map(py, size, truth.flags)?)?;
    Ok(fields)
}

/// Returns a copy of Python's `Truth`.
pub fn truth_of(truth: &Bound<'_, PyAny>) -> PyResult<Truth> {
    let (height, width): (u32, u32) = truth.getattr("depth_mm")?.getattr("shape")?.extract()?;
    let size = [height as usize, width as usize];
    let floats = |name: &str| map_of::<f32>(truth, name, size);
    Ok(Truth {
        width,
        height,
        depth_mm: floats("depth_mm")?,
        projector_x: floats("projector_x")?,
        projector_y: floats("projector_y")?,
        point_mm: vector_map_of(truth, "point_mm", size)?,
        normal: vector_map_of(truth, "normal", size)?,
        object: map_of(truth, "object", size)?,
        albedo: floats("albedo")?,
        irradiance_w_m2: floats("irradiance_w_m2")?,
        mean_dn: floats("mean_dn")?,
        modulation_dn: floats("modulation_dn")?,
        noise_dn: floats("noise_dn")?,
        flags: map_of(truth, "flags", size)?,
    })
}

/// Compares a decoding with a truth; the figures as JSON.
#[pyfunction]
pub fn compare(
    py: Python<'_>,
    decoding: &Bound<'_, PyAny>,
    truth: &Bound<'_, PyAny>,
    rig: &Rig,
) -> PyResult<String> {
    let manifest = decoding.getattr("manifest")?.getattr("_inner")?;
    let manifest = &manifest.cast::<Manifest>()?.get().0;
    let (maps, truth, rig) = (maps_of(decoding)?, truth_of(truth)?, rig.0);
    if maps.depth.is_empty() {
        let error = Error::input("decoding", "no depth", "one by a calibration");
        return Err(raised(error));
    }
    let stop = phasmid::Stop::default();
    let score = crate::call::quiet(py, &stop, || {
        phasmid::study::score::score(&maps, &truth, manifest, &rig)
    })?;
    to_json(&score)
}

/// Reads faults from JSON.
pub fn faults_of<T: serde::de::DeserializeOwned>(json: &str) -> PyResult<T> {
    from_json(
        json,
        "fault",
        "a fault as in a schedule, see `phasmid faults list`",
    )
}
