//! Inputs of the tracker, from ideal to scanned skin; successive inputs differ by one effect.

use crate::clinic::{InRoom, Moment, Pods, binned};
use crate::draws::Draws;
use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_decode::Decoded;
use phasmid_measure::{GROSS_MM, Stated};
use phasmid_profile::Profile;
use phasmid_render::Term;
use phasmid_render::truth::Truth;
use phasmid_sgrt::{Measured, POINTS, Region};

/// Columns and rows of the pods' cameras, with the profile's field of view: half as many pixels per side
/// as in the profile, because the tracker uses only [`POINTS`] points of a scan.
pub(super) const SIZE_PX: [u32; 2] = [320, 240];
/// Standard deviation in millimetres that the tracker is given for noise-free points.
const IDEAL_SIGMA_MM: f64 = 0.1;
/// Noise that Wu et al. add to an ideal skin, in millimetres along each axis.
pub(super) const NOISE_MM: f64 = 0.5;

/// A kind of skin data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Input {
    /// Points of the true skin, evenly over the region.
    Ideal,
    /// As `Ideal`, with noise of half a millimetre along each axis.
    Noisy,
    /// Skin scanned by the pods in turn, while the patient breathes.
    Scanned,
    /// Scanned skin of a patient frozen in the middle of the scan.
    Still,
    /// As `Still`, with skin that light does not enter.
    Opaque,
    /// As `Opaque`, without sensor noise.
    Quiet,
    /// Points of the true skin at the pixels where the `Still` scan has points.
    Seen,
}

impl Input {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Noisy => "noisy",
            Self::Scanned => "scanned",
            Self::Still => "still",
            Self::Opaque => "opaque",
            Self::Quiet => "quiet",
            Self::Seen => "seen",
        }
    }
}

/// Skin data, with its errors where the truth is known pixel by pixel.
pub(super) struct Skin {
    pub(super) input: Input,
    pub(super) measured: Measured,
    pub(super) against: Option<Against>,
}

/// Depths of all pods compared with the true ones at the same time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Against {
    /// Fraction of the points that are more than a millimetre off, or at pixels that see no surface.
    pub(super) gross: f64,
    /// Fraction of the points off by more than five of the standard deviations stated by the decoder.
    pub(super) beyond: f64,
    /// Mean of measured minus true depth over the points without a gross error, in millimetres.
    pub(super) bias_mm: f64,
    /// Root mean square of measured minus true depth over the points without a gross error, in
    /// millimetres.
    pub(super) rmse_mm: f64,
}

/// Three sets of pods in front of one patient: normal, with opaque skin, and with opaque skin without
/// noise.
pub(super) struct Scanners {
    pods: Pods,
    opaque: Pods,
    quiet: Pods,
}

impl Scanners {
    pub(super) fn new(room: &InRoom, seed: u64, size_px: [u32; 2]) -> Result<Self> {
        let sized = |profile: &mut Profile| binned(profile, size_px);
        let quiet = |profile: &mut Profile| {
            sized(profile);
            profile.camera.sensor.noiseless = true;
        };
        let mut opaque = Pods::new(&room.scene, seed, &sized)?;
        for pod in &mut opaque.all {
            pod.renderer().force(Term::Subsurface, false);
        }
        // Without noise and subsurface scattering, only geometric errors remain.
        let mut silent = Pods::new(&room.scene, seed, &quiet)?;
        for pod in &mut silent.all {
            pod.renderer().force(Term::Subsurface, false);
        }
        Ok(Self {
            pods: Pods::new(&room.scene, seed, &sized)?,
            opaque,
            quiet: silent,
        })
    }

    pub(super) fn duration_ns(&self) -> u64 {
        self.pods.duration_ns()
    }

    /// Returns all inputs for a scan that begins at a device time.
    pub(super) fn skins(
        &mut self,
        start_ns: u64,
        (room, moment): (&InRoom, &Moment),
        draws: &Draws,
    ) -> Result<Vec<Skin>> {
        let middle_ns = start_ns + self.duration_ns() / 2;
        let plain = |input, measured| Skin {
            input,
            measured,
            against: None,
        };
        let exact = room.skin(moment, Region::CHEST);
        let noisy = exact.iter().enumerate().map(|(i, p)| {
            let [xy, z] = [0, 1].map(|k| draws.normals(2 * i as u64 + k));
            *p + xy.extend(z.x) * NOISE_MM
        });
        let noisy = Measured::isotropic(noisy.collect(), NOISE_MM);
        let ideal = Measured::isotropic(exact, IDEAL_SIGMA_MM);
        let mut skins = vec![
            plain(Input::Ideal, ideal.thinned(POINTS)),
            plain(Input::Noisy, noisy.thinned(POINTS)),
        ];
        let scan = self.pods.scan(start_ns, false)?;
        skins.push(plain(Input::Scanned, self.pods.measured(&scan, POINTS)));
        let truth: Vec<Truth> = self
            .pods
            .all
            .iter_mut()
            .map(|p| p.truth(middle_ns))
            .collect();
        let sets = [
            (Input::Still, &mut self.pods),
            (Input::Opaque, &mut self.opaque),
            (Input::Quiet, &mut self.quiet),
        ];
        let mut seen = Vec::new();
        for (input, pods) in sets {
            let scan = pods.scan(start_ns, true)?;
            skins.push(Skin {
                input,
                measured: pods.measured(&scan, POINTS),
                against: Some(against(&scan, &truth)),
            });
            if input == Input::Still {
                seen = places(pods, &scan, &truth);
            }
        }
        let seen = Measured::isotropic(seen, IDEAL_SIGMA_MM);
        skins.push(plain(Input::Seen, seen.thinned(POINTS)));
        Ok(skins)
    }
}

fn against(scan: &[Decoded], truth: &[Truth]) -> Against {
    let pairs = scan.iter().zip(truth).flat_map(|(scan, truth)| {
        let depths = scan.depth.iter().zip(&truth.depth_mm);
        depths.zip(&scan.depth_sigma)
    });
    // Pairs of error and standard deviation.
    let errors: Vec<(f64, f64)> = pairs
        .filter(|((measured, _), _)| !measured.is_nan())
        .map(|((measured, exact), sigma)| {
            (f64::from(*measured) - f64::from(*exact), f64::from(*sigma))
        })
        .collect();
    let off = errors.iter().map(|(off, _)| *off);
    let inliers: Vec<f64> = off.filter(|off| off.abs() <= GROSS_MM).collect();
    let n = inliers.len() as f64;
    Against {
        gross: 1.0 - n / errors.len() as f64,
        bias_mm: inliers.iter().sum::<f64>() / n,
        rmse_mm: (inliers.iter().map(|off| off * off).sum::<f64>() / n).sqrt(),
        beyond: Stated::of(errors.into_iter()).beyond_5_sigma,
    }
}

/// Returns the true surface points at the pixels that have a measured point.
fn places(pods: &Pods, scan: &[Decoded], truth: &[Truth]) -> Vec<DVec3> {
    let mut places = Vec::new();
    for ((pod, scan), truth) in pods.all.iter().zip(scan).zip(truth) {
        let depths = scan.depth.iter().zip(&truth.depth_mm).enumerate();
        let both = depths.filter(|(_, (measured, exact))| !measured.is_nan() && !exact.is_nan());
        places.extend(both.map(|(i, (_, exact))| pod.place(i, f64::from(*exact))));
    }
    places
}
