//! A trial scan of a device: the noise of its coordinates, and their error due to held projector
//! pixels.

use crate::scanned::Stage;
use phasmid_core::error::Result;
use phasmid_decode::{Options, Plan, Summary};
use phasmid_profile::{Profile, Scene};
use phasmid_render as render;
use serde::Serialize;

/// Largest number of columns and rows of the image.
const SIDE: u32 = 96;
/// Tilt of the plane about the vertical axis in degrees. A plane without a tilt would show few
/// positions within a projector pixel.
pub const TILT_DEG: f64 = 20.0;

/// Noise and error due to held projector pixels on a tilted plane of albedo 0.3: medians in projector
/// pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sampling {
    /// Distance of the plane along the camera's axis in millimetres; the axes of camera and projector
    /// meet there.
    pub distance_mm: f64,
    /// Standard deviation due to noise; `None` if no pixel has a coordinate.
    pub sigma_px: Option<f32>,
    /// Uncertainty due to held projector pixels, after their correction.
    pub sampling_px: Option<f32>,
    /// The decoder's notes.
    pub notes: Vec<String>,
}

impl Sampling {
    /// Scans with the middle of the camera's image and the profile's first sequence. Returns `None`
    /// if the sequence cannot be decoded, or if the axes of camera and projector do not meet.
    ///
    /// # Errors
    /// Returns an error if the renderer or the decoder refuses the profile.
    ///
    /// ```
    /// use phasmid_profile::Profile;
    /// use phasmid_study::sampling::Sampling;
    ///
    /// let found = Sampling::of(&Profile::load("webcam-grey")?)?.expect("a sequence to decode");
    /// assert!(found.sampling_px < found.sigma_px);
    /// # Ok::<(), phasmid_core::error::Error>(())
    /// ```
    pub fn of(profile: &Profile) -> Result<Option<Self>> {
        let mut profile = profile.clone();
        let camera = &mut profile.camera;
        let size = [camera.width_px, camera.height_px].map(|side| side.min(SIDE));
        camera.sensor_width_mm *= f64::from(size[0]) / f64::from(camera.width_px);
        [camera.width_px, camera.height_px] = size;
        let can_decode = |sequence| Plan::new(&profile.manifest(sequence)).is_ok();
        let Some(distance_mm) = profile
            .nominal_rig()
            .meeting_mm()
            .filter(|_| profile.sequence.first().is_some_and(can_decode))
        else {
            return Ok(None);
        };
        let scene = Scene::parse(
            &format!(
                "name = \"tilted-plane\"\ndescription = \"\"\n[[object]]\nshape = {{ kind = \"plane\" }}\n\
                 position_mm = [0.0, 0.0, {distance_mm:?}]\nrotation_deg = [0.0, {TILT_DEG:?}, 0.0]\n\
                 albedo = 0.3\n"
            ),
            "tilted plane",
        )?;
        let scanned = Stage::new(&profile, &scene, 0, render::Options::default())?.scan(0)?;
        let (decoder, decoded) = scanned.decode(Options::default())?;
        let summary = Summary::new(&decoder, &decoded);
        let axis = summary.axes.first();
        Ok(Some(Self {
            distance_mm,
            sigma_px: axis.and_then(|axis| axis.median_sigma_px),
            sampling_px: axis.and_then(|axis| axis.median_sampling_px),
            notes: summary.notes,
        }))
    }
}
