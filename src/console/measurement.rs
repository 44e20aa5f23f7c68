//! Views of a scan. A view is computed only when a viewer asks for it.

use phasmid_core::error::Result;
use serde::Serialize;
use std::any::Any;
use std::borrow::Cow;

/// A scan whose views are computed on request.
pub trait Measurement: Any + Send + Sync {
    /// Returns a description of the scan and of the available views.
    ///
    /// # Errors
    /// Returns why the scan has no result, for example because it cannot be decoded.
    fn about(&self) -> Result<About>;

    /// Returns the values of a layer of [`About::layers`], row by row; missing values are NaN.
    ///
    /// # Errors
    /// Returns an error if the layer is unknown or cannot be computed.
    fn layer(&self, name: &str) -> Result<Vec<f32>>;

    /// Returns at most `most` points in the rig's frame in millimetres, each with its value of a
    /// layer. The layer `true_depth` has the points of the true surface.
    ///
    /// # Errors
    /// Returns an error if there are no points, and the errors of [`Self::layer`].
    fn cloud(&self, layer: &str, most: usize) -> Result<Points>;

    /// Returns a file with the measurement.
    ///
    /// # Errors
    /// Returns an error if there is nothing to write.
    fn file(&self, kind: FileKind) -> Result<Vec<u8>>;
}

/// A file that a viewer can save.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// The points with normals, intensities and standard deviations, in PLY.
    Cloud,
    /// All layers, as an archive of NumPy arrays.
    Arrays,
}

impl FileKind {
    /// Returns the kind of file that has this name.
    pub(crate) fn of_name(name: &str) -> Option<Self> {
        match name {
            "cloud.ply" => Some(Self::Cloud),
            "scan.npz" => Some(Self::Arrays),
            _ => None,
        }
    }
}

/// Description of a measurement and of its views.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct About {
    /// Name of the sequence, if it has one.
    pub sequence: Option<String>,
    /// Columns of each layer.
    pub width: usize,
    /// Rows of each layer.
    pub height: usize,
    /// Maps with a value per pixel.
    pub layers: Vec<Layer>,
    /// Whether there are points.
    pub cloud: bool,
    /// Figures of the result: a name and a value with its unit.
    pub figures: Vec<(&'static str, String)>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// Fields of view of camera and projector.
    pub fields: Vec<Field>,
}

/// A map with a value per pixel.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Layer {
    /// Short name, in requests.
    pub name: &'static str,
    /// Title.
    pub title: &'static str,
    /// Unit; empty for pure numbers.
    pub unit: &'static str,
    /// Meaning of the values.
    #[serde(flatten)]
    pub scale: Scale,
}

/// Meaning of a layer's values.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "scale")]
pub enum Scale {
    /// Values on a linear scale.
    Linear,
    /// Positive and negative values around zero.
    Signed,
    /// Angles in radians from 0 to 2 pi, where the two ends are the same.
    Turn,
    /// Numbers of classes, from 0.
    Classes {
        /// Name of each class.
        names: Vec<&'static str>,
    },
}

/// The field of view of a camera or projector, in the rig's frame in millimetres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Field {
    /// Name of the device.
    pub name: Cow<'static, str>,
    /// Projection centre.
    pub apex: [f64; 3],
    /// Directions through the corners of the image: upper left, upper right, lower right, lower left.
    pub corners: [[f64; 3]; 4],
}

/// Points, each with a value.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// Position (x, y, z) in the rig's frame in millimetres, then the value.
    pub points: Vec<[f32; 4]>,
    /// Spacing of the points in the camera image, in pixels, along rows and columns.
    pub every: usize,
}
