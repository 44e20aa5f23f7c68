//! One device and scene whose properties a test varies one by one; [`super::device`] draws random ones.

use crate::zoo::measure::Scan;
use phasmid::decode::FrameDoubt;
use phasmid::decode::Options;
use phasmid::emulator::Truth;
use std::f64::consts::TAU;
use std::fmt::Write;

/// Distance of the scene in mm.
const DISTANCE: f64 = 500.0;
/// Columns of the projector.
pub const COLUMNS: u32 = 1024;
/// Rows of the projector.
const ROWS: u32 = 768;
/// Width of the border of the projector's image, in projector pixels.
const BORDER: f32 = 32.0;

/// The lens that is out of focus.
#[derive(Clone, Copy, Debug)]
pub enum Blurred {
    Camera,
    Projector,
}

/// The object in front of a tilted plane.
#[derive(Clone, Copy, Debug)]
pub enum Subject {
    Nothing,
    /// No object, and the plane is not tilted: all pixels see the same few parts of projector
    /// pixels.
    NoTilt,
    /// A sphere half sunk into the plane.
    Bump,
    /// A sphere whose silhouette is far in front of the plane.
    Ball,
    /// A torso of half the image's size, whose silhouette is in front of the plane.
    Torso,
}

/// A device in front of a tilted plane.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Projector pixels per camera pixel.
    pub w: f64,
    /// The blurred lens and the diameter of the blur at the scene's distance, in projector pixels.
    pub blur: Option<(Blurred, f64)>,
    /// Bits per sample.
    pub bits: u32,
    pub full_well_e: f64,
    pub read_noise_e: f64,
    pub subject: Subject,
    /// Patterns as in a profile's file.
    pub patterns: Vec<String>,
}

impl Setup {
    /// The profile's file.
    fn profile(&self) -> String {
        let focal_px = 1.4 * f64::from(COLUMNS);
        let sensor_mm = 8.0 * 640.0 * self.w / focal_px;
        // Both lenses are focused at half the distance: see phasmid::profile::Focus.
        let aperture_mm = |disc_px: f64| disc_px * DISTANCE / focal_px;
        let (f_number, camera_focus, projector_focus) = match self.blur {
            Some((Blurred::Camera, px)) => (
                8.0 / aperture_mm(px),
                format!("focus_mm = {:?}\n", DISTANCE / 2.0),
                String::new(),
            ),
            Some((Blurred::Projector, px)) => (
                8.0,
                String::new(),
                format!(
                    "focus = {{ distance_mm = {:?}, aperture_mm = {:.4} }}\n",
                    DISTANCE / 2.0,
                    aperture_mm(px)
                ),
            ),
            None => (8.0, String::new(), String::new()),
        };
        // Half of the range at the scene's distance.
        let intensity = 0.0075 * self.full_well_e / 10_000.0 * (1.2 * f_number / self.w).powi(2);
        let (bits, full_well_e, read_noise_e) = (self.bits, self.full_well_e, self.read_noise_e);
        let full_scale = f64::from((1u32 << bits) - 1);
        let black_dn = full_scale / 64.0;
        let mut text = format!(
            "name = \"setup\"\ndescription = \"A device\"\n[identity]\n\
             manufacturer = \"Zoo\"\nmodel = \"setup\"\nserial = \"1\"\nfirmware = \"1\"\n\
             [camera]\nwidth_px = 640\nheight_px = 480\nfocal_length_mm = 8.0\n\
             sensor_width_mm = {sensor_mm:.5}\nf_number = {f_number:.4}\n{camera_focus}\
             format = \"{}\"\nexposure_us = 8000.0\nexposure_range_us = [20.0, 1000000.0]\n\
             max_gain_db = 12.0\nframe_interval_us = 20000.0\n\
             [camera.sensor]\nquantum_efficiency = 0.6\nfull_well_e = {full_well_e:?}\n\
             read_noise_e = {read_noise_e:?}\ngain_dn_per_e = {:.9}\nblack_level_dn = {black_dn:?}\n\
             bits = {bits}\n[projector]\nwidth_px = {COLUMNS}\nheight_px = {ROWS}\nthrow_ratio = 1.4\n\
             position_mm = [120.0, 0.0, 0.0]\nlens_shift_px = [{:.3}, 0.0]\nbits = 8\n\
             radiant_intensity_w_sr = {intensity:.6}\nwavelength_nm = 530.0\n{projector_focus}\
             [[sequence]]\nname = \"setup\"\nperiod_us = 20000.0\n",
            if bits == 8 { "GREY" } else { "Y16" },
            (full_scale - black_dn) / full_well_e,
            focal_px * 120.0 / DISTANCE,
        );
        for pattern in &self.patterns {
            writeln!(text, "[[sequence.frame]]\npattern = {{ {pattern} }}").unwrap();
        }
        text
    }

    /// Scans, decodes and evaluates the points.
    pub fn scan(&self) -> Found {
        self.scan_with(Options::default())
    }

    /// Scans, decodes with options and evaluates the points.
    pub fn scan_with(&self, options: Options) -> Found {
        // The torso's width is 380 mm.
        let field_mm = DISTANCE * 640.0 * self.w / (1.4 * f64::from(COLUMNS));
        let (shape, z, scale) = match self.subject {
            Subject::Nothing | Subject::NoTilt => ("", 0.0, 0.0),
            Subject::Bump => ("kind = \"sphere\", radius_mm = 40.0", 20.0, 1.0),
            Subject::Ball => (
                "kind = \"sphere\", radius_mm = 40.0",
                80.0,
                field_mm / 250.0,
            ),
            Subject::Torso => ("kind = \"torso\", seed = 1", 30.0, field_mm / 760.0),
        };
        let tilt_deg = match self.subject {
            Subject::NoTilt => [0.0; 3],
            _ => [4.0, 12.0, 0.0],
        };
        let mut scene = format!(
            "name = \"setup\"\ndescription = \"A plane\"\n\
             [[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [0.0, 0.0, {DISTANCE:?}]\n\
             rotation_deg = {tilt_deg:?}\nalbedo = 0.6\n"
        );
        if !shape.is_empty() {
            write!(
                scene,
                "[[object]]\nshape = {{ {shape} }}\nscale = {scale:.4}\n\
                 position_mm = [20.0, 10.0, {:?}]\nrotation_deg = [0.0, 0.0, 90.0]\nalbedo = 0.6\n",
                DISTANCE - z
            )
            .unwrap();
        }
        Found::new(&Scan::new(&self.profile(), &scene, 1, options))
    }
}

/// Equal steps of one period along x.
pub fn fringes(period_px: f64, steps: u32) -> Vec<String> {
    let of_step = |step| {
        let phase = TAU * f64::from(step) / f64::from(steps);
        format!(
            "kind = \"fringe\", axis = \"x\", period_px = {period_px:?}, phase_rad = {phase:.12}"
        )
    };
    (0..steps).map(of_step).collect()
}

/// A Gray code along x, each bit followed by its complement if `pairs`.
pub fn gray(cell_px: f64, pairs: bool) -> Vec<String> {
    let bits = (f64::from(COLUMNS) / cell_px).log2().ceil() as u32;
    let of_bit = |bit| {
        let shown = [false, true].into_iter().take(1 + usize::from(pairs));
        shown.map(move |inverted| {
            format!(
                "kind = \"gray\", axis = \"x\", cell_px = {cell_px:?}, bits = {bits}, bit = {bit}, \
                 inverted = {inverted}"
            )
        })
    };
    (0..bits).rev().flat_map(of_bit).collect()
}

/// White and black.
pub fn references() -> Vec<String> {
    vec!["kind = \"white\"".to_owned(), "kind = \"black\"".to_owned()]
}

/// Results of a scan: fraction of the lit pixels with a coordinate, RMS of error / sigma over errors
/// within five sigma, fraction of errors beyond, and the median sigma in projector pixels.
pub struct Found {
    pub coverage: f64,
    pub ratio: f64,
    pub beyond: f64,
    pub sigma: f32,
    /// RMS of the errors within half a projector pixel, in projector pixels, away from the border of
    /// the projector's image, where nothing is corrected.
    pub residual: f64,
    /// Pixels that see more than one facet: their number, and the number of those whose coordinate is
    /// more than a projector pixel off.
    pub at_edges: [usize; 2],
    /// Result of the host's checks of the frames.
    pub checked: Result<(), FrameDoubt>,
    /// The decoder's notes.
    pub notes: String,
}

impl Found {
    fn new(scan: &Scan) -> Self {
        let map = scan.decoded.x.as_ref().unwrap();
        let wanted = Truth::SEEN | Truth::LIT | Truth::SQUARE;
        let not = Truth::CREASE | Truth::SATURATED;
        let lit = (0..map.sigma.len()).filter(|&i| scan.truth.flags[i] & (wanted | not) == wanted);
        let (mut all, mut errors, mut sigmas, mut residuals) =
            (0, Vec::new(), Vec::new(), Vec::new());
        for i in lit {
            all += 1;
            if !map.coordinate[i].is_nan() {
                let error = f64::from(map.coordinate[i] - scan.truth.projector_x[i]);
                let [x, y] = [scan.truth.projector_x[i], scan.truth.projector_y[i]];
                let is_inside = (BORDER..COLUMNS as f32 - BORDER).contains(&x)
                    && (BORDER..ROWS as f32 - BORDER).contains(&y);
                if is_inside && error.abs() < 0.5 {
                    residuals.push(error * error);
                }
                errors.push(error.abs() / f64::from(map.uncertainty(i)));
                sigmas.push(map.sigma[i]);
            }
        }
        assert!(all > 100_000, "{all} lit pixels");
        let edge = (0..map.sigma.len())
            .filter(|&i| scan.truth.flags[i] & Truth::CREASE != 0)
            .collect::<Vec<_>>();
        let is_wrong = |i: &&usize| (map.coordinate[**i] - scan.truth.projector_x[**i]).abs() > 1.0;
        let at_edges = [edge.len(), edge.iter().filter(is_wrong).count()];
        let points = errors.len() as f64;
        let within: Vec<_> = errors.iter().filter(|error| **error <= 5.0).collect();
        let squares: f64 = within.iter().map(|error| *error * *error).sum();
        let middle = sigmas.len() / 2;
        sigmas.sort_by(f32::total_cmp);
        Self {
            coverage: points / f64::from(all),
            ratio: (squares / within.len() as f64).sqrt(),
            beyond: 1.0 - within.len() as f64 / points,
            sigma: sigmas[middle],
            residual: (residuals.iter().sum::<f64>() / residuals.len() as f64).sqrt(),
            at_edges,
            checked: scan.checked.clone(),
            notes: scan.decoded.notes.join("; "),
        }
    }
}
