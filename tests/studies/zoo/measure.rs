//! Scans a device once and compares the result with the truth, in units of the standard deviation
//! that the decoder states.

use crate::zoo::device::Device;
use phasmid::decode::{Decoded, Decoder, FrameDoubt, Known, Options, Verdict, check_sequence};
use phasmid::emulator::render::Renderer;
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::geometry::Rig;
use phasmid::pattern::{Axis, Manifest, finest_fringe};
use phasmid::profile::{Profile, Scene};
use std::fmt;
use std::sync::Arc;

/// Number of standard deviations beyond which an error is gross.
pub const FEW: f64 = 5.0;
/// Number of groups into which the points are divided by each quantity; each group is evaluated
/// separately.
const PARTS: usize = 5;
/// Factor on the decoder's modulation thresholds. Only pixels above it must be decoded, so that
/// noise does not decide which ones count.
const ABOVE_THRESHOLD: f64 = 1.5;

/// Accuracy of a scan.
pub struct Measured {
    /// Projector pixels per camera pixel: deciles 1, 5 and 9.
    pub w: [f64; 3],
    /// Fraction of the lit, resolved pixels that became points.
    pub coverage: f64,
    /// Reasons for which the other pixels were dropped, with their numbers.
    pub dropped: Vec<(&'static str, usize)>,
    /// RMS of error / stated standard deviation, over errors within [`FEW`].
    pub ratio: f64,
    /// Minimum and maximum of the same ratio over groups by standard deviation, by w and by
    /// modulation.
    pub parts: [[f64; 2]; 3],
    /// Fraction of points beyond [`FEW`].
    pub beyond: f64,
    /// RMS over bins of the mean of error / standard deviation, by the coordinate modulo one pixel
    /// and modulo one period: systematic errors as opposed to noise.
    pub bias: [f64; 2],
    /// The decoder's notes.
    pub notes: Vec<String>,
    /// Result of the host's checks of the frames.
    pub checked: Result<(), FrameDoubt>,
}

/// A scan of a scene with noise, decoded with the exact calibration.
pub struct Scan {
    pub manifest: Manifest,
    pub rig: Rig,
    pub truth: Truth,
    pub decoded: Decoded,
    /// Result of the host's checks of the frames.
    pub checked: Result<(), FrameDoubt>,
}

impl Scan {
    /// Scans a scene with the first sequence of a device; both are texts of their files.
    pub fn new(profile: &str, scene: &str, seed: u64, options: Options) -> Self {
        let profile = Profile::parse(profile, "zoo").unwrap_or_else(|e| panic!("{e}"));
        let scene = Scene::parse(scene, "zoo").unwrap_or_else(|e| panic!("{e}"));
        let mut renderer = Renderer::new(&profile, &scene, seed).unwrap();
        let manifest = profile.manifest(&profile.sequence[0]);
        let patterns = manifest.frame.iter().map(|frame| frame.pattern.clone());
        let shots: Vec<_> = patterns
            .enumerate()
            .map(|(i, pattern)| {
                let pattern_image =
                    PatternImage::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap();
                let shot = Shot {
                    id: i as u64,
                    noise_id: i as u64,
                    pattern_index: Some(i as u32),
                    pattern_image: Some(Arc::new(pattern_image)),
                    light: 1.0,
                    exposure_ns: (profile.camera.exposure_us * 1e3) as u64,
                    ..Shot::default()
                };
                (pattern, shot)
            })
            .collect();
        let images = shots.iter().map(|(_, s)| renderer.expose(s).into_image());
        let images = images.collect::<Result<Vec<_>, _>>().unwrap();
        let truth = renderer.truth(&shots);
        let rig = profile.nominal_rig();
        let (w, h) = (truth.width as usize, truth.height as usize);
        let decoder = Decoder::new(&manifest, w, h, Some(&rig), options).unwrap();
        Self {
            decoded: decoder.decode(&images).unwrap(),
            checked: check_sequence(&manifest, &images, Known::default())
                .and_then(|()| check_sequence(&manifest, &images, Known::new(false, Some(&rig)))),
            manifest,
            rig,
            truth,
        }
    }
}

/// Scans a device's scene and evaluates the points.
pub fn measure(device: &Device, seed: u64) -> Measured {
    let Scan {
        manifest,
        rig,
        truth,
        decoded,
        checked,
    } = Scan::new(&device.profile, &device.scene, seed, Options::default());
    let fringe = finest_fringe(manifest.frame.iter().map(|f| &f.pattern));
    let (axis, period) = fringe.unwrap();
    assert_eq!(axis, Axis::X);
    let steps = (manifest.frame.iter())
        .filter(|f| finest_fringe(std::iter::once(&f.pattern)) == fringe)
        .count();
    // Minimum modulation, relative to a sample's standard deviation, that the default options
    // accept.
    let least = (2.0 / steps as f64).sqrt() / f64::from(Options::default().max_phase_sigma_rad);
    let noise = rig.noise.unwrap();
    let is_wanted = |i: usize| {
        let (mean, b) = (truth.mean_dn[i].into(), f64::from(truth.modulation_dn[i]));
        let threshold = f64::from(Options::default().min_modulation_dn)
            .max(least * noise.variance_dn2(mean).sqrt())
            .max(f64::from(Options::default().min_contrast) * (mean - noise.black_level_dn));
        let wanted = Truth::SEEN | Truth::LIT | Truth::SQUARE;
        let not = Truth::CREASE | Truth::SATURATED | Truth::UNRESOLVED;
        truth.flags[i] & (wanted | not) == wanted && b > ABOVE_THRESHOLD * threshold
    };
    Measured {
        checked,
        ..tally(&decoded, &truth, period, is_wanted)
    }
}

/// A point of the scan.
struct Point {
    /// Error divided by its stated standard deviation.
    error: f64,
    /// Quantities that define the groups: standard deviation in projector pixels, w, modulation.
    by: [f64; 3],
    /// True projector coordinate in pixels.
    x: f64,
}

fn tally(
    decoded: &Decoded,
    truth: &Truth,
    period: f64,
    is_wanted: impl Fn(usize) -> bool,
) -> Measured {
    let width = decoded.width;
    let map = decoded.x.as_ref().unwrap();
    let x = |i: usize| f64::from(truth.projector_x[i]);
    let (mut wanted, mut found) = (0, 0);
    let mut dropped = [0; Verdict::ALL.len()];
    let (mut points, mut beyond, mut all) = (Vec::new(), 0, 0);
    for i in width..truth.depth_mm.len() - width {
        let is_point = decoded.depth[i].is_finite();
        if is_wanted(i) {
            wanted += 1;
            found += usize::from(is_point);
            dropped[map.verdict[i] as usize] += usize::from(!is_point);
        }
        if !is_point || truth.flags[i] & Truth::CREASE != 0 {
            continue;
        }
        all += 1;
        let error =
            f64::from(decoded.depth[i] - truth.depth_mm[i]) / f64::from(decoded.depth_sigma[i]);
        // A point without a true value counts as gross.
        if !(error.abs() <= FEW) {
            beyond += 1;
            continue;
        }
        let slope = [x(i + 1) - x(i - 1), x(i + width) - x(i - width)].map(|d| d / 2.0);
        points.push(Point {
            error,
            by: [
                map.sigma[i].into(),
                slope[0].hypot(slope[1]),
                truth.modulation_dn[i].into(),
            ],
            x: x(i),
        });
    }
    let ws = sorted(points.iter().map(|p| p.by[1]).filter(|w| w.is_finite()));
    let decile = |k: usize| ws.get(k * ws.len() / 10).copied().unwrap_or(f64::NAN);
    Measured {
        w: [1, 5, 9].map(decile),
        coverage: found as f64 / f64::from(wanted),
        dropped: Verdict::ALL
            .iter()
            .map(|verdict| (verdict.name(), dropped[*verdict as usize]))
            .filter(|(_, count)| *count > 0)
            .collect(),
        ratio: rms(points.iter().map(|p| p.error)),
        parts: [0, 1, 2].map(|by| extremes(&points, by)),
        beyond: f64::from(beyond) / f64::from(all),
        bias: [
            bias(&points, |p| (p.x + 0.5).rem_euclid(1.0)),
            bias(&points, |p| (p.x / period).rem_euclid(1.0)),
        ],
        notes: decoded.notes.clone(),
        checked: Ok(()),
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<_> = values.collect();
    all.sort_by(f64::total_cmp);
    all
}

fn rms(errors: impl Iterator<Item = f64>) -> f64 {
    let (mut n, mut sum) = (0.0, 0.0);
    for error in errors {
        n += 1.0;
        sum += error * error;
    }
    f64::sqrt(sum / n)
}

/// Minimum and maximum RMS over groups of points by one of the quantities.
fn extremes(points: &[Point], by: usize) -> [f64; 2] {
    let mut order: Vec<_> = points.iter().filter(|p| p.by[by].is_finite()).collect();
    order.sort_by(|a, b| a.by[by].total_cmp(&b.by[by]));
    let part = order.len().div_ceil(PARTS).max(1);
    let parts = order
        .chunks(part)
        .map(|part| rms(part.iter().map(|p| p.error)));
    parts.fold([f64::INFINITY, 0.0], |[least, most], rms| {
        [least.min(rms), most.max(rms)]
    })
}

/// RMS over bins of a coordinate, from 0 to 1, of the mean of error / standard deviation.
fn bias(points: &[Point], of: impl Fn(&Point) -> f64) -> f64 {
    const BINS: usize = 20;
    let mut bins = [(0.0, 0.0); BINS];
    for point in points {
        let bin = &mut bins[(of(point) * BINS as f64) as usize % BINS];
        bin.0 += 1.0;
        bin.1 += point.error;
    }
    rms(bins
        .iter()
        .filter(|(n, _)| *n > 0.0)
        .map(|(n, sum)| sum / n))
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c] = self.w;
        let ([s0, s1], [w0, w1], [m0, m1]) = (self.parts[0], self.parts[1], self.parts[2]);
        write!(
            f,
            "w {a:.2} {b:.2} {c:.2}  coverage {:.4}  ratio {:.3}  by sigma {s0:.2}..{s1:.2} \
             w {w0:.2}..{w1:.2} modulation {m0:.2}..{m1:.2}  beyond {:.5}  bias {:.2} {:.2}",
            self.coverage, self.ratio, self.beyond, self.bias[0], self.bias[1]
        )?;
        for (verdict, count) in &self.dropped {
            write!(f, "  {verdict} {count}")?;
        }
        self.notes
            .iter()
            .try_for_each(|note| write!(f, "  [{note}]"))
    }
}
