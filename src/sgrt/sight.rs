//! Checks a pod's frames against their sequence, decodes them and transforms the points to the room.

use super::measured::Measured;
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, Decoded, FrameDoubt, Known, Options, SparseDecoder, check_sequence};
use phasmid_geometry::Pose;
use phasmid_pattern::Image;

/// Minimum number of pixels decoded per pod: larger images are subsampled to about this number.
pub const PIXELS: usize = 60_000;

/// Turns the successive scans of one pod into measured points.
pub struct Sight {
    name: String,
    room_from_rig: Pose,
    /// Created for the sequence and calibration of the first scan.
    decoder: Option<SparseDecoder>,
    decoded: Decoded,
    points: Vec<[f32; 3]>,
}

impl Sight {
    /// Creates a sight for a pod; `name` appears in error messages, `room_from_rig` is the pose of
    /// its camera.
    pub fn new(name: &str, room_from_rig: Pose) -> Self {
        Self {
            name: name.to_owned(),
            room_from_rig,
            decoder: None,
            decoded: Decoded::default(),
            points: Vec::new(),
        }
    }

    /// Decodes as many pixels of a scan as tracking needs ([`PIXELS`]) and adds at most `most` of its
    /// points to `measured`.
    ///
    /// Frames that do not follow their sequence add no points; the difference is returned. Set
    /// `identified` if the link identifies each frame. All scans must have the sequence and
    /// calibration of the first.
    ///
    /// # Errors
    /// Returns an error if the frames cannot be decoded or the device has no calibration.
    pub fn measure(
        &mut self,
        captured: &Capture,
        identified: bool,
        measured: &mut Measured,
        most: usize,
    ) -> Result<Option<FrameDoubt>> {
        if captured.calibration.is_none() {
            return Err(Error::device(format!(
                "{}: the device provides no calibration",
                self.name
            )));
        }
        let known = Known::new(identified, captured.calibration.as_ref());
        let (checked, depths) = rayon::join(
            || check_sequence(&captured.manifest, &captured.images, known),
            || self.depths(captured),
        );
        depths?;
        if let Err(why) = checked {
            // The pods after this one keep their indices.
            measured.push_pod(&[], &[], &self.room_from_rig, most);
            return Ok(Some(why));
        }
        if let Some(decoder) = &self.decoder {
            decoder
                .decoder()
                .points_into(&self.decoded, &mut self.points);
        }
        let depths = self.decoded.depth.iter().zip(&self.decoded.depth_sigma);
        let known = depths.filter(|(depth, _)| !depth.is_nan());
        let sigma: Vec<f32> = known.map(|(_, sigma)| *sigma).collect();
        measured.push_pod(&self.points, &sigma, &self.room_from_rig, most);
        Ok(None)
    }

    fn depths(&mut self, captured: &Capture) -> Result<()> {
        let decoder = match &self.decoder {
            Some(decoder) => decoder,
            None => self.decoder.insert(SparseDecoder::new(
                &captured.manifest,
                Image::common_size(&captured.images)?,
                captured.calibration.as_ref(),
                Options::default(),
                PIXELS,
            )?),
        };
        decoder.decode_into(&captured.images, &mut self.decoded)
    }
}
