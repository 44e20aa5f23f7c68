//! Random but realistic devices and scenes, as the TOML that a user would write.

use std::f64::consts::TAU;
use std::fmt::Write;

/// Resolutions of cameras and projectors on the market, in pixels.
const CAMERAS: [[u32; 2]; 5] = [
    [640, 480],
    [800, 600],
    [1024, 768],
    [1280, 1024],
    [1440, 1080],
];
const PROJECTORS: [[u32; 2]; 6] = [
    [640, 360],
    [854, 480],
    [912, 1140],
    [1024, 768],
    [1280, 800],
    [1920, 1080],
];
/// Columns to which a camera is reduced, so that many devices render quickly. The projector is
/// reduced by the same factor, which preserves projector pixels per camera pixel.
const QUICK_COLUMNS: u32 = 512;
/// One device in twenty keeps its full size.
const FULL_SIZE_EVERY: u64 = 20;
/// Distance of the nearest surface divided by that of the scene's centre.
const NEAREST: f64 = 0.85;
/// Photon energy at 530 nm in joules: h c / wavelength.
const PHOTON_J: f64 = 3.748e-19;
const EXPOSURE_US: f64 = 8000.0;
const QUANTUM_EFFICIENCY: f64 = 0.6;
const ALBEDO: f64 = 0.7;

/// SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators", OOPSLA 2014).
struct Draw(u64);

impl Draw {
    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.word() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Draws a number whose logarithm is uniformly distributed.
    fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.range(low.ln(), high.ln()).exp()
    }

    fn whole(&mut self, low: u32, high: u32) -> u32 {
        low + (self.word() % u64::from(high - low + 1)) as u32
    }

    fn chance(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    fn pick<T: Copy>(&mut self, list: &[T]) -> T {
        list[(self.word() % list.len() as u64) as usize]
    }

    fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }
}

/// A device in front of a scene.
pub struct Device {
    /// Contents of the device profile's file.
    pub profile: String,
    /// Contents of the scene's file.
    pub scene: String,
    /// One-line summary of what distinguishes the device.
    pub label: String,
}

impl Device {
    /// Generates the device of a seed.
    pub fn new(seed: u64) -> Self {
        let mut draw = Draw(seed.wrapping_mul(0xD134_2543_DE82_EF95));
        // Parameters that the others depend on.
        let full = seed % FULL_SIZE_EVERY == FULL_SIZE_EVERY - 1;
        let ([wc, hc], [wp, hp]) = (draw.pick(&CAMERAS), draw.pick(&PROJECTORS));
        let factor = if full { 1 } else { wc.div_ceil(QUICK_COLUMNS) };
        let [wc, hc, wp, hp] = [wc, hc, wp, hp].map(|side| side / factor);
        let distance = draw.scale(150.0, 1500.0);
        let focal_mm = draw.pick(&[4.0, 6.0, 8.0, 12.0, 16.0]);
        // Focal length divided by the sensor's width: 53 to 26 degrees horizontally.
        let tele = draw.range(1.0, 2.2);
        let sensor_mm = focal_mm / tele;
        let camera_focal_px = tele * f64::from(wc);
        // The projector's image covers the camera's field of view.
        let cover = draw.range(1.0, 1.35);
        let throw = tele / cover;
        let projector_focal_px = throw * f64::from(wp);
        let baseline = draw.sign() * distance * draw.range(0.15, 0.5);
        let toed_in = draw.chance(0.5);
        let (rotation, shift) = if toed_in {
            (-(baseline / distance).atan().to_degrees(), 0.0)
        } else {
            (0.0, projector_focal_px * baseline / distance)
        };
        let aside = baseline.abs() * draw.range(-0.05, 0.05);
        let camera_bend = bend(&mut draw, 0.05, [wc, hc], 0.0, camera_focal_px);
        let projector_bend = bend(&mut draw, 0.03, [wp, hp], shift, projector_focal_px);

        // Blur at the nearest surface in pixels, and the apertures that produce it.
        let off_focus = (1.0 / NEAREST - 1.0) / distance;
        let camera_blur = draw.chance(0.5).then(|| draw.range(0.3, 2.0));
        let projector_blur = draw.chance(0.6).then(|| draw.range(0.3, 3.0));
        let f_number = match camera_blur {
            Some(px) => (focal_mm * camera_focal_px * off_focus / px).clamp(1.4, 22.0),
            None => draw.range(2.0, 11.0),
        };

        // The sensor, and light that fills a fraction of its full well.
        let bits = draw.pick(&[8, 10, 12]);
        let full_scale = f64::from((1u32 << bits) - 1);
        let full_well_e = draw.scale(5000.0, 40_000.0);
        let black_dn = f64::from(1u32 << (bits - 6));
        let pitch_m = sensor_mm / f64::from(wc) * 1e-3;
        let filled = draw.range(0.4, 0.85) * full_well_e;
        let photons = filled / QUANTUM_EFFICIENCY;
        // A Lambertian surface under I / d^2, seen through a lens: E = rho I / (4 N^2 d^2).
        let irradiance = photons * PHOTON_J / (pitch_m.powi(2) * EXPOSURE_US * 1e-6);
        let nearest_m = NEAREST * distance * 1e-3;
        let intensity = irradiance * 4.0 * f_number.powi(2) * nearest_m.powi(2) / ALBEDO;
        let gamma = draw.chance(0.25).then(|| draw.range(1.3, 2.2));

        let mut p = String::new();
        let mut line = |text: std::fmt::Arguments<'_>| writeln!(p, "{text}").unwrap();
        line(format_args!("name = \"zoo-{seed}\""));
        line(format_args!("description = \"A random device\""));
        line(format_args!("[identity]"));
        line(format_args!("manufacturer = \"Zoo\"\nmodel = \"zoo\""));
        line(format_args!("serial = \"{seed}\"\nfirmware = \"1\""));
        line(format_args!("[camera]\nwidth_px = {wc}\nheight_px = {hc}"));
        line(format_args!("focal_length_mm = {focal_mm:?}"));
        line(format_args!("sensor_width_mm = {sensor_mm:.4}"));
        line(format_args!("distortion = {camera_bend:?}"));
        line(format_args!("f_number = {f_number:.3}"));
        if camera_blur.is_some() {
            let focus = distance * draw.range(0.95, 1.05);
            line(format_args!("focus_mm = {focus:.2}"));
        }
        let natural = draw.chance(0.5);
        line(format_args!("vignetting = {{ natural = {natural} }}"));
        let format = if bits == 8 { "GREY" } else { "Y16" };
        line(format_args!("format = \"{format}\""));
        line(format_args!("exposure_us = {EXPOSURE_US:?}"));
        line(format_args!("exposure_range_us = [20.0, 1000000.0]"));
        line(format_args!(
            "max_gain_db = 12.0\nframe_interval_us = 20000.0"
        ));
        line(format_args!("[camera.sensor]"));
        line(format_args!("quantum_efficiency = {QUANTUM_EFFICIENCY:?}"));
        line(format_args!("full_well_e = {full_well_e:.0}.0"));
        line(format_args!("read_noise_e = {:.2}", draw.range(2.0, 10.0)));
        let gain = (full_scale - black_dn) / full_well_e;
        line(format_args!("gain_dn_per_e = {gain:.6}"));
        line(format_args!("black_level_dn = {black_dn:?}\nbits = {bits}"));
        line(format_args!("prnu_percent = {:.2}", draw.range(0.0, 1.0)));
        line(format_args!(
            "[projector]\nwidth_px = {wp}\nheight_px = {hp}"
        ));
        line(format_args!("throw_ratio = {throw:.4}"));
        line(format_args!("lens_shift_px = [{shift:.2}, 0.0]"));
        line(format_args!(
            "position_mm = [{baseline:.3}, {aside:.3}, 0.0]"
        ));
        line(format_args!("rotation_deg = [0.0, {rotation:.4}, 0.0]"));
        line(format_args!("distortion = {projector_bend:?}\nbits = 8"));
        line(format_args!("radiant_intensity_w_sr = {intensity:.6}"));
        line(format_args!("wavelength_nm = 530.0"));
        if let Some(gamma) = gamma {
            line(format_args!("response = {{ gamma = {gamma:.2} }}"));
        }
        if draw.chance(0.7) {
            let contrast = draw.scale(100.0, 2000.0);
            line(format_args!("contrast_ratio = {contrast:.0}.0"));
        }
        if let Some(px) = projector_blur {
            let aperture = px / (projector_focal_px * off_focus);
            let focus = distance * draw.range(0.95, 1.05);
            line(format_args!(
                "focus = {{ distance_mm = {focus:.2}, aperture_mm = {aperture:.4} }}"
            ));
        }
        let (steps, period) = (draw.whole(4, 12), draw.whole(10, 20));
        let code = draw.pick(&["gray", "gray", "gray-pairs", "periods"]);
        line(format_args!(
            "[[sequence]]\nname = \"zoo\"\nperiod_us = 20000.0"
        ));
        sequence(&mut p, code, [steps, period], wp);
        let scene = scene(&mut draw, distance, distance / tele);

        let number = |n: Option<f64>| n.map_or("-".to_owned(), |n| format!("{n:.1}"));
        let label = format!(
            "{wc}x{hc} {wp}x{hp} {steps} steps {period} px {code} {bits} bit gamma {} blur {} {}",
            number(gamma),
            number(camera_blur),
            number(projector_blur),
        );
        Self {
            profile: p,
            scene,
            label,
        }
    }
}

/// Distortion that moves a point by at most a fraction of its distance from the principal point.
fn bend(draw: &mut Draw, most: f64, [w, h]: [u32; 2], shift: f64, focal_px: f64) -> [f64; 5] {
    let corner = (f64::from(w) / 2.0 + shift.abs()).hypot(f64::from(h) / 2.0) / focal_px;
    let share = draw.range(-most, most);
    let k1 = share / corner.powi(2);
    let k2 = -share * draw.range(0.0, 0.3) / corner.powi(4);
    let mut tangential = || draw.range(-3e-4, 3e-4);
    let all = [k1, k2, tangential(), tangential(), 0.0];
    all.map(|k| (k * 1e6).round() / 1e6)
}

fn sequence(text: &mut String, code: &str, [steps, period]: [u32; 2], columns: u32) {
    let mut frame = |pattern: String| {
        writeln!(text, "[[sequence.frame]]\npattern = {{ {pattern} }}").unwrap();
    };
    let mut fringes = |period_px: f64, steps: u32| {
        for k in 0..steps {
            let phase = TAU * f64::from(k) / f64::from(steps);
            frame(format!(
                "kind = \"fringe\", axis = \"x\", period_px = {period_px:?}, phase_rad = {phase:.12}"
            ));
        }
    };
    let fine = f64::from(period);
    fringes(fine, steps);
    if code == "periods" {
        // A coarse period that covers the image, and one in between at equal ratios.
        let whole = 1.1 * f64::from(columns);
        let middle = (fine * whole).sqrt();
        for coarse in [middle, whole] {
            fringes((coarse * 10.0).round() / 10.0, steps.min(6));
        }
        return;
    }
    let bits = (f64::from(columns) / fine).log2().ceil() as u32;
    let mut gray = |cell_px: f64, bits: u32, bit: u32| {
        let pairs = code == "gray-pairs";
        for inverted in [false, true].into_iter().take(if pairs { 2 } else { 1 }) {
            frame(format!(
                "kind = \"gray\", axis = \"x\", cell_px = {cell_px:?}, bits = {bits}, \
                 bit = {bit}, inverted = {inverted}"
            ));
        }
    };
    for bit in (0..bits).rev() {
        gray(fine, bits, bit);
    }
    // The code's edges are half a cell away from those of the fringes.
    gray(fine / 2.0, bits + 1, 0);
    frame("kind = \"white\"".to_owned());
    frame("kind = \"black\"".to_owned());
}

/// A tilted plane, in most cases with a sphere or a torso in front of it.
fn scene(draw: &mut Draw, distance: f64, field_mm: f64) -> String {
    let tilt = [0; 2].map(|_| draw.sign() * draw.range(3.0, 18.0));
    let mut text = format!(
        "name = \"zoo\"\ndescription = \"A random scene\"\n[[object]]\n\
         shape = {{ kind = \"plane\" }}\nposition_mm = [0.0, 0.0, {distance:.2}]\n\
         rotation_deg = [{:.2}, {:.2}, 0.0]\nalbedo = {:.2}\n",
        tilt[0],
        tilt[1],
        draw.range(0.4, ALBEDO)
    );
    let [x, y] = [0; 2].map(|_| draw.range(-0.12, 0.12) * field_mm);
    let (shape, size, z) = match draw.whole(0, 2) {
        0 => return text,
        1 => {
            let radius = field_mm * draw.range(0.12, 0.2);
            let shape = format!("kind = \"sphere\", radius_mm = {radius:.2}");
            (shape, 1.0, distance - 0.3 * radius)
        }
        _ => {
            // The torso is 380 mm wide.
            let size = field_mm * draw.range(0.4, 0.6) / 380.0;
            ("kind = \"torso\", seed = 1".to_owned(), size, distance)
        }
    };
    writeln!(
        text,
        "[[object]]\nshape = {{ {shape} }}\nposition_mm = [{x:.2}, {y:.2}, {z:.2}]\n\
         rotation_deg = [{:.2}, {:.2}, {:.2}]\nscale = {size:.4}\nalbedo = {:.2}",
        tilt[0],
        tilt[1],
        draw.range(0.0, 180.0),
        draw.range(0.4, ALBEDO)
    )
    .unwrap();
    text
}
