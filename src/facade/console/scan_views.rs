//! The views of a scan.

use crate::facade::{Decoding, ask_service, decode};
use phasmid_console::{About, Field, FileKind, Layer, Measurement, Points, Scale};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{AxisMap, Capture, Decoded, Known, Options, Order, Verdict, check_sequence};
use phasmid_geometry::View;
use phasmid_geometry::ply::encode_cloud;
use phasmid_pattern::Axis;
use phasmid_protocol::service::Request;
use phasmid_render::npz::{self, Array};
use rayon::ThreadPool;
use std::borrow::Cow;
use std::f32::consts::TAU;
use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A scan that a console shows. It is decoded when a viewer first asks for it.
///
/// ```
/// use phasmid::console::Measurement;
/// use phasmid::{Device, ScanViews};
///
/// let mut device = Device::builder().profile("webcam-grey").scene("sphere").build()?;
/// let mut capture = device.scan("quick-4")?;
/// capture.calibration = Some(device.factory_calibration()?);
/// let views = ScanViews::new(capture);
/// let names: Vec<_> = views.about()?.layers.iter().map(|layer| layer.name).collect();
/// assert!(names.contains(&"depth") && names.contains(&"phase_x"));
/// assert_eq!(views.layer("depth")?.len(), 640 * 480);
/// assert!(views.cloud("depth_sigma", 300_000)?.points.len() > 10_000);
/// # Ok::<(), phasmid::Error>(())
/// ```
pub struct ScanViews {
    capture: Arc<Capture>,
    name: Option<String>,
    service: Option<PathBuf>,
    pool: Option<Arc<ThreadPool>>,
    decoding: OnceLock<Decoding>,
    true_depth: OnceLock<Vec<f32>>,
    /// Locked while `decoding` or `true_depth` is computed.
    computing: Mutex<()>,
}

impl ScanViews {
    /// Creates the views of a capture; depth requires a calibration in the capture.
    pub fn new(capture: impl Into<Arc<Capture>>) -> Self {
        Self {
            capture: capture.into(),
            name: None,
            service: None,
            pool: None,
            decoding: OnceLock::new(),
            true_depth: OnceLock::new(),
            computing: Mutex::default(),
        }
    }

    /// Sets the name of the sequence.
    #[must_use]
    pub fn named(self, sequence: impl Into<String>) -> Self {
        let name = Some(sequence.into());
        Self { name, ..self }
    }

    /// Sets the service channel of an emulated device, which reports the truth.
    #[must_use]
    pub fn with_service(self, service: impl Into<PathBuf>) -> Self {
        let service = Some(service.into());
        Self { service, ..self }
    }

    /// Makes the views decode the scan with the threads of this pool.
    pub(super) fn in_pool(self, pool: Arc<ThreadPool>) -> Self {
        let pool = Some(pool);
        Self { pool, ..self }
    }

    /// Returns the frames.
    pub(super) fn capture(&self) -> &Capture {
        &self.capture
    }

    fn decoding(&self) -> Result<&Decoding> {
        self.once(&self.decoding, || match &self.pool {
            Some(pool) => pool.install(|| self.decode()),
            None => self.decode(),
        })
    }

    /// Returns a value that is computed at the first call and then kept; after an error, the next
    /// call tries again.
    fn once<'a, T>(
        &'a self,
        known: &'a OnceLock<T>,
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<&'a T> {
        let computing = self
            .computing
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let value = match known.get() {
            Some(value) => value,
            None => {
                let value = compute()?;
                known.get_or_init(|| value)
            }
        };
        drop(computing);
        Ok(value)
    }

    fn decode(&self) -> Result<Decoding> {
        let capture = &self.capture;
        let known = Known::new(true, capture.calibration.as_ref());
        check_sequence(&capture.manifest, &capture.images, known)
            .map_err(|doubt| Error::device(doubt.to_string()))?;
        decode(capture, &capture.calibration, &Options::default())
    }

    /// Returns the true depth at the middle of the scan.
    fn true_depth(&self) -> Result<&[f32]> {
        let wanted = self.decoding()?.maps.depth.len();
        self.once(&self.true_depth, || self.ask_depth(wanted))
            .map(Vec::as_slice)
    }

    fn ask_depth(&self, wanted: usize) -> Result<Vec<f32>> {
        let middle = self.capture.frames.get(self.capture.frames.len() / 2);
        let (Some(service), Some(middle)) = (&self.service, middle) else {
            return Err(Error::device("the truth of a physical device is unknown"));
        };
        let (_, maps) = ask_service(service, &Request::TruthOfFrame(middle.id))?;
        let depth = { maps.maps.into_iter() }.find(|(name, _)| name == "depth_mm");
        let depth = depth.map(|(_, depth)| depth).unwrap_or_default();
        if depth.len() != wanted {
            let why = "the truth is known for the whole sensor only, not for a region of interest";
            return Err(Error::device(why));
        }
        Ok(depth)
    }
}

impl fmt::Debug for ScanViews {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = &self.name;
        f.debug_struct("ScanViews")
            .field("name", name)
            .finish_non_exhaustive()
    }
}

/// Content of a layer.
#[derive(Clone, Copy)]
enum Shows {
    Depth,
    DepthSigma,
    Error,
    TrueDepth,
    Phase(Axis),
    Order(Axis),
    Coordinate(Axis),
    Sigma(Axis),
    Modulation,
    Intensity,
    Mask,
}

/// Name, title, unit and content of a layer.
type Row = (&'static str, &'static str, &'static str, Shows);

/// Name of the layer with the true depth.
const TRUE_DEPTH: &str = "true_depth";

const LAYERS: [Row; 15] = [
    ("depth", "Depth", "mm", Shows::Depth),
    ("depth_sigma", "Deviation of depth", "mm", Shows::DepthSigma),
    ("error", "Error of depth", "mm", Shows::Error),
    (TRUE_DEPTH, "True depth", "mm", Shows::TrueDepth),
    ("phase_x", "Phase, x", "rad", Shows::Phase(Axis::X)),
    ("order_x", "Fringe order, x", "", Shows::Order(Axis::X)),
    (
        "projector_x",
        "Projector column",
        "px",
        Shows::Coordinate(Axis::X),
    ),
    (
        "sigma_x",
        "Deviation of column",
        "px",
        Shows::Sigma(Axis::X),
    ),
    ("phase_y", "Phase, y", "rad", Shows::Phase(Axis::Y)),
    ("order_y", "Fringe order, y", "", Shows::Order(Axis::Y)),
    (
        "projector_y",
        "Projector row",
        "px",
        Shows::Coordinate(Axis::Y),
    ),
    ("sigma_y", "Deviation of row", "px", Shows::Sigma(Axis::Y)),
    ("modulation", "Modulation", "DN", Shows::Modulation),
    ("intensity", "White minus black", "", Shows::Intensity),
    ("mask", "Mask with reasons", "", Shows::Mask),
];

impl Decoding {
    /// Returns the finest period of an axis in projector pixels, if it has fringes.
    fn period_px(&self, axis: Axis) -> Option<f32> {
        let plan = self.decoder.plan().axis(axis)?;
        plan.sets.first().map(|set| set.period_px as f32)
    }

    /// Returns whether the fringe order of an axis is known.
    fn has_order(&self, axis: Axis) -> bool {
        let plan = self.decoder.plan().axis(axis);
        plan.is_some_and(|plan| {
            !plan.sets.is_empty() && !matches!(plan.order, Order::Wrapped { .. })
        })
    }

    fn has(&self, shows: Shows, truth: bool) -> bool {
        let depth = !self.maps.depth.is_empty();
        match shows {
            Shows::Depth | Shows::DepthSigma => depth,
            Shows::Error | Shows::TrueDepth => depth && truth,
            Shows::Phase(axis) => self.maps.axis(axis).is_some() && self.period_px(axis).is_some(),
            Shows::Order(axis) => self.maps.axis(axis).is_some() && self.has_order(axis),
            Shows::Coordinate(axis) | Shows::Sigma(axis) => self.maps.axis(axis).is_some(),
            Shows::Modulation | Shows::Intensity | Shows::Mask => true,
        }
    }
}

fn scale(shows: Shows) -> Scale {
    match shows {
        Shows::Error => Scale::Signed,
        Shows::Phase(_) => Scale::Turn,
        Shows::Mask => Scale::Classes {
            names: Verdict::ALL.map(Verdict::name).to_vec(),
        },
        _ => Scale::Linear,
    }
}

/// Returns the verdict of each pixel: the reason of the first axis that rejects the pixel.
fn verdicts(maps: &Decoded) -> Vec<f32> {
    let of = |i: usize| {
        let mut verdicts = maps.axes().map(|(_, map)| map.verdict[i]);
        verdicts
            .find(|verdict| *verdict != Verdict::Valid)
            .unwrap_or_default()
    };
    let pixels = 0..maps.width * maps.height;
    pixels.map(|i| f32::from(of(i) as u8)).collect()
}

pub(super) fn field(name: impl Into<Cow<'static, str>>, view: &View) -> Field {
    let (right, below) = (
        f64::from(view.lens.width_px) - 0.5,
        f64::from(view.lens.height_px) - 0.5,
    );
    let corners = [[-0.5, -0.5], [right, -0.5], [right, below], [-0.5, below]];
    Field {
        name: name.into(),
        apex: view.center_mm(),
        corners: corners.map(|corner| view.ray(corner)),
    }
}

/// Returns the key figures of a decoding, each as a name and a value with its unit.
fn figures(decoding: &Decoding) -> Vec<(&'static str, String)> {
    let summary = decoding.summary();
    let mut all = vec![("Frames", summary.frames.to_string())];
    let percent = |count: usize| format!("{:.1} %", 100.0 * count as f64 / summary.pixels as f64);
    if let Some(points) = summary.points {
        all.push(("Points", format!("{points} ({})", percent(points))));
    }
    let number = |value: Option<f32>, unit: &str| value.map(|value| format!("{value:.4} {unit}"));
    let medians = [
        (
            "Depth ±, median",
            number(summary.median_depth_sigma_mm, "mm"),
        ),
        (
            "Modulation, median",
            number(summary.median_modulation_dn, "DN"),
        ),
    ];
    all.extend(
        medians
            .into_iter()
            .filter_map(|(name, value)| Some((name, value?))),
    );
    for axis in &summary.axes {
        let [valid, sigma] = match axis.axis {
            Axis::X => ["Columns found", "Column ±, median"],
            Axis::Y => ["Rows found", "Row ±, median"],
        };
        all.push((valid, percent(axis.valid)));
        all.extend(number(axis.median_sigma_px, "px").map(|value| (sigma, value)));
    }
    all
}

impl Measurement for ScanViews {
    fn about(&self) -> Result<About> {
        let decoding = self.decoding()?;
        let truth = self.service.is_some();
        let layers = LAYERS
            .iter()
            .filter(|(.., shows)| decoding.has(*shows, truth));
        let rig = decoding.decoder.triangulator().map(|found| *found.rig());
        let fields = rig.map(|rig| {
            let devices = [("camera", &rig.camera), ("projector", &rig.projector)];
            devices.map(|(name, view)| field(name, view)).to_vec()
        });
        Ok(About {
            sequence: self.name.clone(),
            width: decoding.maps.width,
            height: decoding.maps.height,
            layers: layers
                .map(|&(name, title, unit, shows)| Layer {
                    name,
                    title,
                    unit,
                    scale: scale(shows),
                })
                .collect(),
            cloud: rig.is_some(),
            figures: figures(decoding),
            notes: decoding.maps.notes.clone(),
            fields: fields.unwrap_or_default(),
        })
    }

    fn layer(&self, name: &str) -> Result<Vec<f32>> {
        let decoding = self.decoding()?;
        let maps = &decoding.maps;
        let truth = self.service.is_some();
        let layer = LAYERS
            .iter()
            .find(|(own, .., shows)| *own == name && decoding.has(*shows, truth));
        let Some(&(.., shows)) = layer else {
            return Err(Error::input("layer", name, "one that the measurement has"));
        };
        let none = AxisMap::default();
        let map = |axis| maps.axis(axis).unwrap_or(&none);
        let period = |axis| decoding.period_px(axis).unwrap_or(f32::NAN);
        let periods = |axis| {
            let period = period(axis);
            map(axis).coordinate.iter().map(move |x| x / period)
        };
        Ok(match shows {
            Shows::Depth => maps.depth.clone(),
            Shows::DepthSigma => maps.depth_sigma.clone(),
            Shows::TrueDepth => self.true_depth()?.to_vec(),
            Shows::Error => {
                let pairs = maps.depth.iter().zip(self.true_depth()?);
                pairs.map(|(measured, exact)| measured - exact).collect()
            }
            Shows::Phase(axis) => periods(axis)
                .map(|turns| TAU * turns.rem_euclid(1.0))
                .collect(),
            Shows::Order(axis) => periods(axis).map(f32::floor).collect(),
            Shows::Coordinate(axis) => map(axis).coordinate.clone(),
            Shows::Sigma(axis) => map(axis)
                .uncertainties(0..map(axis).sigma.len())
                .into_owned(),
            Shows::Modulation => maps.modulation.clone(),
            Shows::Intensity => maps.intensity.clone(),
            Shows::Mask => verdicts(maps),
        })
    }

    fn cloud(&self, layer: &str, most: usize) -> Result<Points> {
        let values = self.layer(layer)?;
        let decoding = self.decoding()?;
        let maps = &decoding.maps;
        // Points of the true surface lie at the true depth, all other points at the measured depth.
        let depth = match layer {
            TRUE_DEPTH => &values,
            _ => &maps.depth,
        };
        let Some(triangulator) = decoding.decoder.triangulator() else {
            return Err(Error::device("there are no points without a calibration"));
        };
        let grid = |every| {
            let rows = (0..maps.height).step_by(every);
            let pixels =
                rows.flat_map(move |v| (0..maps.width).step_by(every).map(move |u| (u, v)));
            pixels.filter(|(u, v)| !depth[v * maps.width + u].is_nan())
        };
        let mut every = 1;
        while grid(every).count() > most.max(1) {
            every += 1;
        }
        let points = grid(every).map(|(u, v)| {
            let i = v * maps.width + u;
            let [x, y, z] = triangulator.point(u, v, depth[i]);
            [x, y, z, values[i]]
        });
        Ok(Points {
            points: points.collect(),
            every,
        })
    }

    fn file(&self, kind: FileKind) -> Result<Vec<u8>> {
        let decoding = self.decoding()?;
        match kind {
            FileKind::Cloud if decoding.decoder.triangulator().is_none() => {
                Err(Error::device("there are no points without a calibration"))
            }
            FileKind::Cloud => encode_cloud(&decoding.cloud()),
            FileKind::Arrays => {
                let about = self.about()?;
                let shape = [about.height, about.width];
                // Leave out layers that fail: if the device has ended, it cannot report the truth.
                let arrays = about.layers.iter().filter_map(|layer| {
                    let values = self.layer(layer.name).ok()?;
                    Some(Array::floats(layer.name, &shape, &values))
                });
                let mut file = Vec::new();
                npz::write(&mut file, arrays).map_err(|e| Error::io("scan.npz", e))?;
                Ok(file)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facade::Device;

    fn scanned(sequence: &str, calibrated: bool) -> Capture {
        let device = Device::builder().profile("webcam-grey").scene("sphere");
        let mut device = device.build().unwrap();
        let mut capture = device.scan(sequence).unwrap();
        let rig = device.factory_calibration().unwrap();
        capture.calibration = calibrated.then_some(rig);
        capture
    }

    fn names(views: &ScanViews) -> Vec<&'static str> {
        let about = views.about().unwrap();
        about.layers.iter().map(|layer| layer.name).collect()
    }

    #[test]
    fn layers_are_those_that_the_scan_has() {
        let x = ["phase_x", "order_x", "projector_x", "sigma_x"];
        let y = ["phase_y", "order_y", "projector_y", "sigma_y"];
        let every = ["modulation", "intensity", "mask"];
        let views = ScanViews::new(scanned("quick-4", true)).named("quick-4");
        assert_eq!(
            names(&views),
            [&["depth", "depth_sigma"], &x[..], &every].concat()
        );
        let about = views.about().unwrap();
        assert_eq!(about.sequence.as_deref(), Some("quick-4"));
        for name in names(&views) {
            assert_eq!(views.layer(name).unwrap().len(), about.width * about.height);
        }
        // The true depth is known to an emulated device only.
        let why = views.layer("error").unwrap_err().to_string();
        assert_eq!(why, "layer: error; expected one that the measurement has");
        let bare = ScanViews::new(scanned("quick-4-xy", false));
        assert_eq!(names(&bare), [&x[..], &y, &every].concat());
        assert!(!bare.about().unwrap().cloud && bare.cloud("mask", 9).is_err());
    }

    #[test]
    fn cloud_has_the_depths_and_is_thinned_out_evenly() {
        let views = ScanViews::new(scanned("quick-4", true));
        let depth = views.layer("depth").unwrap();
        let valid: Vec<_> = depth.iter().filter(|depth| !depth.is_nan()).collect();
        let all = views.cloud("depth", usize::MAX).unwrap();
        assert_eq!((all.every, all.points.len()), (1, valid.len()));
        // In this profile, the camera's frame is the rig's frame.
        assert!(
            all.points
                .iter()
                .zip(valid)
                .all(|(point, depth)| point[2] == *depth && point[3] == *depth)
        );
        let some = views.cloud("depth_sigma", 10_000).unwrap();
        assert!(some.every > 1 && (5_000..=10_000).contains(&some.points.len()));
        assert!(
            some.points
                .iter()
                .all(|point| point[3] > 0.0 && point[3] < 10.0)
        );
    }

    #[test]
    fn files_have_what_is_shown() {
        let folder = tempfile::tempdir().unwrap();
        let views = ScanViews::new(scanned("quick-4", true));
        let path = folder.path().join("cloud.ply");
        std::fs::write(&path, views.file(FileKind::Cloud).unwrap()).unwrap();
        let cloud = phasmid_geometry::ply::read_cloud(&path).unwrap();
        let shown = views.cloud("depth", usize::MAX).unwrap().points;
        assert!(cloud.normals.is_some() && cloud.points.len() == shown.len());
        assert!(
            shown
                .iter()
                .zip(&cloud.points)
                .all(|(a, b)| a[..3] == b[..])
        );
        let arrays = views.file(FileKind::Arrays).unwrap();
        let text = String::from_utf8_lossy(&arrays);
        for name in names(&views) {
            assert!(text.contains(&format!("{name}.npy")), "{name}");
        }
        assert!(arrays.len() > 4 * 640 * 480 * names(&views).len());
        let bare = ScanViews::new(scanned("quick-4", false));
        assert!(bare.file(FileKind::Cloud).is_err() && bare.file(FileKind::Arrays).is_ok());
    }

    #[test]
    fn phase_and_order_make_up_the_coordinate() {
        let views = ScanViews::new(scanned("quick-4", true));
        let [phase, order, column] =
            ["phase_x", "order_x", "projector_x"].map(|name| views.layer(name).unwrap());
        let off = |i: usize| (16.0 * (order[i] + phase[i] / TAU) - column[i]).abs();
        assert!((0..column.len()).all(|i| column[i].is_nan() || off(i) < 1e-3));
        assert!((0..column.len()).all(|i| column[i].is_nan() == phase[i].is_nan()));
        assert!(
            phase
                .iter()
                .all(|phase| phase.is_nan() || (0.0..=TAU).contains(phase))
        );
    }

    #[test]
    fn frames_that_contradict_the_sequence_are_named() {
        let mut capture = scanned("quick-4", true);
        capture.images[7] = capture.images[0].clone();
        let views = ScanViews::new(capture);
        let why = views.about().unwrap_err().to_string();
        assert!(why.contains("contradict"), "{why}");
        assert_eq!(views.layer("depth").unwrap_err().to_string(), why);
    }
}
