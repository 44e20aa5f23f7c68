//! `--method`: how projector coordinates are converted to points.

use super::decoding::doubt;
use phasmid_calibrate::height::{Given, Mapping};
use phasmid_core::error::{Error, Result};
use phasmid_decode::MANIFEST_FILE;
use phasmid_decode::{Decoded, Decoder, Options, Plan, load_frames};
use phasmid_geometry::Rig;
use phasmid_pattern::{Axis, Image, Manifest};
use std::path::{Path, PathBuf};

/// Options of the conversion from projector coordinates to points.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct MethodArgs {
    /// How to convert projector coordinates to points
    #[arg(long, value_enum, default_value_t = Method::Triangulation)]
    method: Method,
    /// For --method height: a scan of the bare reference plane
    #[arg(long, value_name = "DIR", conflicts_with = "plane_mm")]
    reference: Option<PathBuf>,
    /// For --method height without --reference: depth in mm of a plane perpendicular to the camera's
    /// axis, computed from the calibration [default: where the rays of the two image centres meet]
    #[arg(long, value_name = "Z")]
    plane_mm: Option<f64>,
    /// For --method height: distance L of the camera from the plane in mm, instead of the
    /// calibration's
    #[arg(long, value_name = "L")]
    height_l_mm: Option<f64>,
    /// For --method height: baseline D in mm, instead of the calibration's
    #[arg(long, value_name = "D")]
    height_d_mm: Option<f64>,
    /// For --method height: fringes per mm on the plane, f0, instead of the reference's
    #[arg(long, value_name = "F0")]
    height_f0_per_mm: Option<f64>,
}

/// Conversion from projector coordinates to points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Method {
    /// Intersection of the rays of camera and projector, with lens distortion
    Triangulation,
    /// Phase to height over a reference plane, h = L dphi / (2 pi f0 D + dphi), as in the paper
    Height,
}

impl MethodArgs {
    /// Rejects numbers that are not finite and positive, options of the other method, and a reference
    /// that cannot be decoded, before anything is captured.
    ///
    /// # Errors
    /// Returns an error that names the option at fault.
    pub(super) fn check(&self) -> Result<()> {
        let numbers = [
            ("--plane-mm", self.plane_mm),
            ("--height-l-mm", self.height_l_mm),
            ("--height-d-mm", self.height_d_mm),
            ("--height-f0-per-mm", self.height_f0_per_mm),
        ];
        for (flag, value) in numbers {
            if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                return Err(Error::input(flag, value, "a finite number above 0"));
            }
        }
        let reference = self.reference.as_ref().map(|_| "--reference");
        let given = numbers
            .iter()
            .find(|(_, v)| v.is_some())
            .map(|(flag, _)| *flag);
        match reference.or(given) {
            Some(flag) if self.method != Method::Height => Err(Error::input(
                flag,
                "given without --method height",
                "--method height, or none of its options",
            )),
            _ => self.reference.as_deref().map_or(Ok(()), Reference::check),
        }
    }

    /// Returns the folder of `--reference`.
    pub(super) fn reference(&self) -> Option<&Path> {
        self.reference.as_deref()
    }

    /// Replaces triangulated depths by depths from this method.
    ///
    /// # Errors
    /// Returns an error if the calibration is missing, the reference is invalid, or the sequence
    /// does not encode a coordinate along the baseline.
    pub(super) fn apply(
        &self,
        decoder: &Decoder,
        decoded: &mut Decoded,
        options: Options,
    ) -> Result<()> {
        if self.method == Method::Triangulation {
            return Ok(());
        }
        let rig = decoder.triangulator().map(|t| *t.rig()).ok_or_else(|| {
            Error::input("--method height", "no calibration", "--calibration FILE")
        })?;
        let capture = self
            .reference
            .as_deref()
            .map(|folder| Reference::open(folder, &rig, options));
        let capture = capture.transpose()?;
        let mut best: Option<Result<Mapping>> = None;
        let resolved = decoded.axes().filter(|(_, map)| map.wrapped_px.is_none());
        for (axis, _) in resolved {
            // Gray code alone has no fringe period. The result does not depend on the period, which only
            // sets the unit of f0, so use one pixel.
            let plan = decoder.plan().axis(axis);
            let period = plan
                .and_then(|p| p.sets.first())
                .map_or(1.0, |set| set.period_px);
            let mapping = self.mapping(&rig, axis, period, capture.as_ref());
            let leverage = |m: &Mapping| {
                (m.constants.baseline_mm * m.constants.fringes_per_mm * m.period_px).abs()
            };
            let better = match (&mapping, &best) {
                (_, None) | (Ok(_), Some(Err(_))) => true,
                (Ok(new), Some(Ok(old))) => leverage(new) > leverage(old),
                (Err(_), _) => false,
            };
            if better {
                best = Some(mapping);
            }
        }
        let mapping = best.unwrap_or_else(|| {
            Err(Error::input(
                "--method height",
                "a sequence that resolves no coordinate",
                "a Gray code or a second period",
            ))
        })?;
        let mapping = mapping.with(&Given {
            distance_mm: self.height_l_mm,
            baseline_mm: self.height_d_mm,
            fringes_per_mm: self.height_f0_per_mm,
        });
        let mut depth = std::mem::take(&mut decoded.depth);
        let mut sigma = std::mem::take(&mut decoded.depth_sigma);
        if let Some(map) = decoded.axis(mapping.axis) {
            let uncertainty = map.uncertainties(0..map.sigma.len());
            mapping.depths([&map.coordinate, &uncertainty], &mut depth, &mut sigma);
        }
        (decoded.depth, decoded.depth_sigma) = (depth, sigma);
        decoded.mapped = true;
        decoded.notes.push(self.note(&mapping));
        Ok(())
    }

    fn mapping(
        &self,
        rig: &Rig,
        axis: Axis,
        period: f64,
        capture: Option<&Reference>,
    ) -> Result<Mapping> {
        let Some(capture) = capture else {
            let z = self.plane_mm.or_else(|| rig.meeting_mm()).ok_or_else(|| {
                Error::input(
                    "--plane-mm",
                    "missing, and the rays of the camera's and the projector's image centres do not meet",
                    "the depth of the reference plane in mm",
                )
            })?;
            return Mapping::of_plane(rig, axis, period, z).map_err(|e| e.at("--plane-mm"));
        };
        let at = |e: Error| e.at(format!("--reference {}", capture.folder.display()));
        let map = capture
            .decoded
            .axis(axis)
            .filter(|map| map.wrapped_px.is_none());
        let map = map.ok_or_else(|| {
            let found = format!("no coordinate along axis {axis}");
            at(Error::input(
                "sequence",
                found,
                "the axes of the scan itself",
            ))
        })?;
        let depth = [&capture.decoded.depth[..], &capture.decoded.depth_sigma];
        let uncertainty = map.uncertainties(0..map.sigma.len());
        let coordinate = [&map.coordinate[..], &uncertainty];
        Mapping::of_capture(rig, axis, period, coordinate, depth).map_err(at)
    }

    fn note(&self, mapping: &Mapping) -> String {
        let c = mapping.constants;
        let q = mapping.quality;
        let from = match &self.reference {
            Some(folder) => format!(
                "captured in {} (flat to {:.3} mm)",
                folder.display(),
                q.plane_rms_mm
            ),
            None => "computed from the calibration".to_owned(),
        };
        format!(
            "points by phase to height over a plane {from}: L = {:.3} mm, D = {:.3} mm, \
             f0 = {:.5} fringes of {} px per mm along {}; exact if the projector were as far from it \
             (it is {:+.3} mm farther) and its coordinate linear on it (it is to {:.3} px)",
            c.distance_mm,
            c.baseline_mm.abs(),
            c.fringes_per_mm,
            mapping.period_px,
            mapping.axis,
            q.farther_mm,
            q.linear_rms_px
        )
    }
}

/// A capture of the reference plane, decoded.
struct Reference {
    folder: PathBuf,
    decoded: Decoded,
}

impl Reference {
    /// Checks that a folder holds a capture that can be decoded.
    fn check(folder: &Path) -> Result<()> {
        let read = || {
            let (manifest, images) = Self::read(folder)?;
            let [width, height] = Image::common_size(&images)?;
            Decoder::new(&manifest, width, height, None, Options::default()).map(drop)
        };
        read().map_err(|e: Error| e.at("--reference"))
    }

    fn read(folder: &Path) -> Result<(Manifest, Vec<Image>)> {
        let manifest = Manifest::read(&folder.join(MANIFEST_FILE))?;
        let plan = Plan::new(&manifest)?;
        let images = load_frames(&manifest, &plan, folder)?;
        Ok((manifest, images))
    }

    fn open(folder: &Path, rig: &Rig, options: Options) -> Result<Self> {
        let read = || {
            let (manifest, images) = Self::read(folder)?;
            let [width, height] = Image::common_size(&images)?;
            let decoder = Decoder::new(&manifest, width, height, Some(rig), options)?;
            let decoded = decoder.decode(&images)?;
            doubt(folder, &manifest, &images, Some(rig), false)?;
            Ok(decoded)
        };
        let decoded = read().map_err(|e: Error| e.at("--reference"))?;
        Ok(Self {
            folder: folder.to_owned(),
            decoded,
        })
    }
}
