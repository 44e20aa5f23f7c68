//! Converts images and maps to numpy arrays and back.

use crate::call::quiet;
use crate::errors::raised;
use numpy::ndarray::{Array2, Array3, ArrayView3};
use numpy::{
    Element, IntoPyArray, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods,
};
use phasmid::pattern::{Image, ImageView, Samples};
use phasmid::{Error, Result, Stop};
use pyo3::prelude::*;
use std::any::Any;
use std::path::PathBuf;

/// Returns a map of `[rows, columns]`, without copying it.
pub fn map<'py, T: Element>(
    py: Python<'py>,
    size: [usize; 2],
    values: Vec<T>,
) -> PyResult<Bound<'py, PyAny>> {
    let array = Array2::from_shape_vec(size, values).map_err(|e| raised(Error::device(e)))?;
    Ok(array.into_pyarray(py).into_any())
}

/// Returns vectors as rows, without copying them.
pub fn vectors<'py>(py: Python<'py>, values: Vec<[f32; 3]>) -> PyResult<Bound<'py, PyAny>> {
    let count = values.len();
    map(py, [count, 3], values.into_flattened())
}

/// Returns a map of vectors of `[rows, columns]`, without copying it.
pub fn vector_map<'py>(
    py: Python<'py>,
    [rows, columns]: [usize; 2],
    values: Vec<[f32; 3]>,
) -> PyResult<Bound<'py, PyAny>> {
    let array = Array3::from_shape_vec((rows, columns, 3), values.into_flattened());
    let array = array.map_err(|e| raised(Error::device(e)))?;
    Ok(array.into_pyarray(py).into_any())
}

/// Images of one size, one after the other.
pub struct Stack {
    shape: (usize, usize, usize),
    samples: Samples,
}

impl Stack {
    /// Copies images into one block.
    ///
    /// # Errors
    /// Returns an error if the images differ in size or in bits per sample.
    pub fn new(images: &[Image]) -> Result<Self> {
        let [width, height] = Image::common_size(images)?;
        let samples = match images.iter().all(|image| image.bits() == 8) {
            true => Samples::U8(joined(images.iter().filter_map(Image::as_u8))),
            false => Samples::U16(joined(images.iter().filter_map(Image::as_u16))),
        };
        Ok(Self {
            shape: (images.len(), height, width),
            samples,
        })
    }

    /// Returns the array, without copying it.
    pub fn into_array(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        fn array<T: Element>(
            py: Python<'_>,
            shape: (usize, usize, usize),
            samples: Vec<T>,
        ) -> PyResult<Bound<'_, PyAny>> {
            let array = Array3::from_shape_vec(shape, samples);
            let array = array.map_err(|e| raised(Error::device(e)))?;
            Ok(array.into_pyarray(py).into_any())
        }
        match self.samples {
            Samples::U8(samples) => array(py, self.shape, samples),
            Samples::U16(samples) => array(py, self.shape, samples),
        }
    }
}

fn joined<'a, T: Copy + 'a>(images: impl Iterator<Item = &'a [T]> + Clone) -> Vec<T> {
    let mut all = Vec::with_capacity(images.clone().map(<[T]>::len).sum());
    images.for_each(|image| all.extend_from_slice(image));
    all
}

/// Frames held by a numpy array.
pub enum Frames<'py> {
    U8(PyReadonlyArray3<'py, u8>),
    U16(PyReadonlyArray3<'py, u16>),
}

impl<'py> Frames<'py> {
    /// # Errors
    /// Returns an error unless it is an array of 8- or 16-bit samples with three axes.
    pub fn of(array: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(frames) = array.extract() {
            return Ok(Self::U8(frames));
        }
        if let Ok(frames) = array.extract() {
            return Ok(Self::U16(frames));
        }
        let expected = "an array of uint8 or uint16 with the shape (frames, rows, columns)";
        Err(raised(Error::input("frames", found(array), expected)))
    }

    /// Borrows each frame.
    ///
    /// # Errors
    /// Returns an error if there are no frames, or if the array is not contiguous.
    pub fn views(&self) -> PyResult<Vec<ImageView<'_>>> {
        let [_, height, width] = self.shape();
        let views: Result<Vec<_>> = match self {
            Self::U8(array) => views(array.as_slice()?, width, height),
            Self::U16(array) => views(array.as_slice()?, width, height),
        };
        views.map_err(raised)
    }

    /// Copies each frame.
    ///
    /// # Errors
    /// Returns an error if there are no frames.
    pub fn images(&self) -> PyResult<Vec<Image>> {
        let [_, height, width] = self.shape();
        let images: Result<Vec<_>> = match self {
            Self::U8(array) => images(array.as_array(), width, height),
            Self::U16(array) => images(array.as_array(), width, height),
        };
        images.map_err(raised)
    }

    /// Returns the number of frames, rows and columns.
    pub fn shape(&self) -> [usize; 3] {
        let shape = match self {
            Self::U8(array) => array.shape(),
            Self::U16(array) => array.shape(),
        };
        [shape[0], shape[1], shape[2]]
    }
}

fn views<T>(samples: &[T], width: usize, height: usize) -> Result<Vec<ImageView<'_>>>
where
    for<'a> &'a [T]: Into<phasmid::pattern::SamplesView<'a>>,
{
    let frames = samples.chunks((width * height).max(1));
    frames
        .map(|frame| ImageView::new(width, height, frame))
        .collect()
}

fn images<T: Copy>(frames: ArrayView3<'_, T>, width: usize, height: usize) -> Result<Vec<Image>>
where
    Vec<T>: Into<Samples>,
{
    let frames = frames.outer_iter();
    frames
        .map(|frame| Image::new(width, height, frame.iter().copied().collect::<Vec<_>>()))
        .collect()
}

/// Describes an array or another value, for messages.
fn found(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => format!(
            "an array of {} with the shape {:?}",
            array.dtype(),
            array.shape()
        ),
        Err(_) => format!("a value of type {}", value.get_type()),
    }
}

/// Copies a map out of the attribute `name` of a Python object, and checks its size.
///
/// # Errors
/// Returns an error unless it is an array of this type with `[rows, columns]`.
pub fn map_of<T: Element + Copy + Any>(
    owner: &Bound<'_, PyAny>,
    name: &str,
    size: [usize; 2],
) -> PyResult<Vec<T>> {
    let array = owner.getattr(name)?;
    let refused = || {
        let [rows, columns] = size;
        let kind = std::any::type_name::<T>();
        let expected = format!("an array of {kind} with the shape ({rows}, {columns})");
        raised(Error::input(name, found(&array), expected))
    };
    let map: PyReadonlyArray2<'_, T> = array.extract().map_err(|_| refused())?;
    if map.shape() != size {
        return Err(refused());
    }
    Ok(map.as_array().iter().copied().collect())
}

/// Copies a map of vectors, as [`map_of`] does.
///
/// # Errors
/// Returns an error unless it is an array of f32 with `[rows, columns, 3]`.
pub fn vector_map_of(
    owner: &Bound<'_, PyAny>,
    name: &str,
    [rows, columns]: [usize; 2],
) -> PyResult<Vec<[f32; 3]>> {
    let array = owner.getattr(name)?;
    let refused = || {
        let expected = format!("an array of f32 with the shape ({rows}, {columns}, 3)");
        raised(Error::input(name, found(&array), expected))
    };
    let map: PyReadonlyArray3<'_, f32> = array.extract().map_err(|_| refused())?;
    if map.shape() != [rows, columns, 3] {
        return Err(refused());
    }
    let values: Vec<f32> = map.as_array().iter().copied().collect();
    Ok(values.as_chunks().0.to_vec())
}

/// Writes frames as PNG files, which are replaced if they exist.
#[pyfunction]
pub fn write_png(py: Python<'_>, frames: &Bound<'_, PyAny>, paths: Vec<PathBuf>) -> PyResult<()> {
    let images = Frames::of(frames)?.images()?;
    let mut pairs = images.iter().zip(&paths);
    quiet(py, &Stop::default(), || {
        pairs.try_for_each(|(image, path)| phasmid::decode::write_png(image, path, true))
    })
}
