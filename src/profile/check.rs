//! Named checks of a profile's values: what cannot exist is refused with its line and its range.

use super::device::{Camera, Profile, Projector, Sensor, Sequence};
use super::scene::{Object, Scene, Shape};
use super::source::TomlSource;
use crate::error::Result;
use crate::geometry::{Lens, shapes};
use crate::pattern::manifest::{MAX_SIDE_PX, check_frames};
use crate::pattern::{Axis, Pattern};
use crate::protocol::{PixelFormat, data_line};
use glam::DVec2;
use std::fmt::{Display, LowerExp};
use std::ops::RangeInclusive;

/// A source with the checks that its values go through.
pub(super) struct Check<'a> {
    source: &'a TomlSource,
}

impl<'a> Check<'a> {
    pub(super) fn new(source: &'a TomlSource) -> Self {
        Self { source }
    }

    /// A finite number in an inclusive range.
    pub(super) fn within<T>(&self, field: &str, value: T, range: RangeInclusive<T>) -> Result<()>
    where
        T: PartialOrd + Display + LowerExp + Copy,
    {
        // NaN compares as outside of every range.
        if range.contains(&value) {
            return Ok(());
        }
        let (low, high) = (range.start(), range.end());
        let allowed = if low == high {
            low.to_string()
        } else {
            format!("{low} to {high}")
        };
        // Three hundred digits tell no more than an exponent.
        let plain = value.to_string();
        let found = if plain.len() <= 24 {
            plain
        } else {
            format!("{value:e}")
        };
        Err(self.source.violation(field, found, allowed))
    }

    fn all_within(&self, field: &str, values: &[f64], range: RangeInclusive<f64>) -> Result<()> {
        values
            .iter()
            .try_for_each(|&value| self.within(field, value, range.clone()))
    }

    pub(super) fn that(
        &self,
        ok: bool,
        field: &str,
        found: impl Display,
        allowed: impl Display,
    ) -> Result<()> {
        if ok {
            Ok(())
        } else {
            Err(self.source.violation(field, found, allowed))
        }
    }
}

pub(super) fn profile(p: &Profile, check: &Check<'_>) -> Result<()> {
    name(&p.name, "name", check)?;
    for (field, text) in [
        ("identity.manufacturer", &p.identity.manufacturer),
        ("identity.model", &p.identity.model),
        ("identity.serial", &p.identity.serial),
        ("identity.firmware", &p.identity.firmware),
    ] {
        let printable = text.chars().all(|c| c.is_ascii_graphic() || c == ' ');
        check.that(
            !text.is_empty() && text.len() <= 64 && printable && !text.contains([',', ';']),
            field,
            format!("{text:?}"),
            "1 to 64 printable ASCII characters without comma or semicolon (IEEE 488.2, 10.14)",
        )?;
    }
    camera(&p.camera, check)?;
    projector(&p.projector, check)?;
    super::usb::check(&p.usb, check)?;
    check.that(
        !p.sequence.is_empty() && p.sequence.len() <= 64,
        "sequence",
        format!("{} sequences", p.sequence.len()),
        "1 to 64 sequences",
    )?;
    for (i, s) in p.sequence.iter().enumerate() {
        sequence(s, i, p, check)?;
        let first = p.sequence.iter().position(|other| other.name == s.name);
        check.that(
            first == Some(i),
            &format!("sequence[{i}].name"),
            format!("{:?} a second time", s.name),
            "a name of its own",
        )?;
    }
    Ok(())
}

fn name(text: &str, field: &str, check: &Check<'_>) -> Result<()> {
    let ok = (1..=64).contains(&text.len())
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'));
    check.that(
        ok,
        field,
        format!("{text:?}"),
        "1 to 64 letters, digits, '-', '_' or '.'",
    )
}

fn camera(c: &Camera, check: &Check<'_>) -> Result<()> {
    check.within("camera.width_px", c.width_px, 8..=MAX_SIDE_PX)?;
    check.within("camera.height_px", c.height_px, 8..=MAX_SIDE_PX)?;
    let pixels = u64::from(c.width_px) * u64::from(c.height_px);
    check.that(
        pixels <= 1 << 26,
        "camera.height_px",
        format!("{pixels} pixels in all"),
        "up to 67108864 pixels",
    )?;
    check.within("camera.focal_length_mm", c.focal_length_mm, 0.1..=10_000.0)?;
    check.within("camera.sensor_width_mm", c.sensor_width_mm, 0.1..=1000.0)?;
    if let Some(point) = c.principal_point_px {
        check.all_within("camera.principal_point_px", &point, -1e6..=1e6)?;
    }
    distortion(&c.view().lens, "camera.distortion", check)?;
    check.within("camera.f_number", c.f_number, 0.5..=128.0)?;
    let [shortest, longest] = c.exposure_range_us;
    check.all_within("camera.exposure_range_us", &[shortest, longest], 0.1..=60e6)?;
    check.that(
        shortest <= longest,
        "camera.exposure_range_us",
        format!("[{shortest}, {longest}]"),
        "the shorter first",
    )?;
    check.within("camera.exposure_us", c.exposure_us, shortest..=longest)?;
    check.within("camera.max_gain_db", c.max_gain_db, 0.0..=60.0)?;
    check.within(
        "camera.frame_interval_us",
        c.frame_interval_us,
        c.exposure_us.max(100.0)..=60e6,
    )?;
    check.that(
        c.format != PixelFormat::Yuyv || c.width_px.is_multiple_of(2),
        "camera.format",
        format!("YUYV of {} columns", c.width_px),
        "GREY, or an even width_px: YUYV holds pairs of pixels",
    )?;
    if c.data_line {
        check.that(
            c.width_px >= data_line::WIDTH_PX,
            "camera.data_line",
            format!("a line above {} columns", c.width_px),
            format!("false, or a width_px of {} or more", data_line::WIDTH_PX),
        )?;
        let longest_told_us = data_line::MAX_EXPOSURE_NS as f64 / 1e3;
        check.that(
            longest <= longest_told_us,
            "camera.data_line",
            format!("a line, and exposures of up to {longest} us"),
            format!("false, or exposures of up to {longest_told_us} us: the line tells no longer"),
        )?;
    }
    sensor(&c.sensor, c.format, check)
}

fn sensor(s: &Sensor, format: PixelFormat, check: &Check<'_>) -> Result<()> {
    check.within(
        "camera.sensor.quantum_efficiency",
        s.quantum_efficiency,
        0.001..=1.0,
    )?;
    check.within("camera.sensor.full_well_e", s.full_well_e, 100.0..=1e7)?;
    check.within("camera.sensor.read_noise_e", s.read_noise_e, 0.0..=1e4)?;
    check.within("camera.sensor.gain_dn_per_e", s.gain_dn_per_e, 1e-6..=1e4)?;
    let bits = match format {
        PixelFormat::Grey | PixelFormat::Yuyv => 8..=8,
        PixelFormat::Y16 => 9..=16,
    };
    check.within("camera.sensor.bits", s.bits, bits)?;
    let half = s.full_scale_dn() / 2.0;
    check.within("camera.sensor.black_level_dn", s.black_level_dn, 0.0..=half)
}

fn projector(p: &Projector, check: &Check<'_>) -> Result<()> {
    check.within("projector.width_px", p.width_px, 8..=MAX_SIDE_PX)?;
    check.within("projector.height_px", p.height_px, 8..=MAX_SIDE_PX)?;
    check.within("projector.throw_ratio", p.throw_ratio, 0.05..=100.0)?;
    check.all_within("projector.lens_shift_px", &p.lens_shift_px, -1e5..=1e5)?;
    check.all_within("projector.position_mm", &p.position_mm, -1e7..=1e7)?;
    let baseline = p.view().center().length();
    check.that(
        baseline >= 1e-3,
        "projector.position_mm",
        format!("{baseline} mm from the camera (zero baseline)"),
        "at least 0.001 mm",
    )?;
    check.all_within("projector.rotation_deg", &p.rotation_deg, -360.0..=360.0)?;
    distortion(&p.view().lens, "projector.distortion", check)?;
    check.within("projector.bits", p.bits, 1..=8)?;
    check.within(
        "projector.radiant_intensity_w_sr",
        p.radiant_intensity_w_sr,
        0.0..=1e6,
    )?;
    check.within("projector.wavelength_nm", p.wavelength_nm, 300.0..=1100.0)
}

/// Refuses coefficients for which some pixel of the border has no ray: the image folds over.
fn distortion(lens: &Lens, field: &str, check: &Check<'_>) -> Result<()> {
    check.all_within(field, &lens.distortion, -1e3..=1e3)?;
    let (w, h) = (
        f64::from(lens.width_px) - 0.5,
        f64::from(lens.height_px) - 0.5,
    );
    for i in 0..=64 {
        let t = f64::from(i) / 64.0;
        let (x, y) = (-0.5 + t * (w + 0.5), -0.5 + t * (h + 0.5));
        for px in [(x, -0.5), (x, h), (-0.5, y), (w, y)] {
            check.that(
                lens.ray(DVec2::from(px)).is_finite(),
                field,
                format!(
                    "an image that folds over at pixel ({:.0}, {:.0})",
                    px.0, px.1
                ),
                "coefficients that can be inverted over the whole image",
            )?;
        }
    }
    Ok(())
}

fn sequence(s: &Sequence, index: usize, p: &Profile, check: &Check<'_>) -> Result<()> {
    let field = |name: &str| format!("sequence[{index}].{name}");
    name(&s.name, &field("name"), check)?;
    check.within(
        &field("period_us"),
        s.period_us,
        p.camera.exposure_us..=60e6,
    )?;
    check_frames(&s.frame, &field("frame"), check.source)?;
    for axis in [Axis::X, Axis::Y] {
        let size = match axis {
            Axis::X => p.projector.width_px,
            Axis::Y => p.projector.height_px,
        };
        gray_reaches(s, index, axis, size, check)?;
    }
    Ok(())
}

/// A Gray code has to number every fringe that the projector shows.
fn gray_reaches(
    s: &Sequence,
    index: usize,
    axis: Axis,
    size: u32,
    check: &Check<'_>,
) -> Result<()> {
    let fringes = s
        .frame
        .iter()
        .any(|f| matches!(f.pattern, Pattern::Fringe { axis: a, .. } if a == axis));
    for (i, frame) in s.frame.iter().enumerate() {
        let Pattern::Gray {
            axis: a,
            cell_px,
            bits,
            ..
        } = frame.pattern
        else {
            continue;
        };
        let reach = cell_px * f64::from(bits).exp2();
        check.that(
            !fringes || a != axis || reach >= f64::from(size),
            &format!("sequence[{index}].frame[{i}].pattern.bits"),
            format!("{bits} bits of {cell_px} px, which number {reach} px"),
            format!(
                "at least {} bits for the fringes over {size} px",
                (f64::from(size) / cell_px).log2().ceil()
            ),
        )?;
    }
    Ok(())
}

pub(super) fn scene(s: &Scene, check: &Check<'_>) -> Result<()> {
    name(&s.name, "name", check)?;
    check.within(
        "ambient.irradiance_w_m2",
        s.ambient.irradiance_w_m2,
        0.0..=1e6,
    )?;
    check.that(
        s.object.len() <= 4096,
        "object",
        format!("{} objects", s.object.len()),
        "up to 4096 objects",
    )?;
    s.object
        .iter()
        .enumerate()
        .try_for_each(|(i, o)| object(o, &format!("object[{i}]"), check))
}

fn object(o: &Object, at: &str, check: &Check<'_>) -> Result<()> {
    let field = |name: &str| format!("{at}.{name}");
    check.all_within(&field("position_mm"), &o.position_mm, -1e9..=1e9)?;
    check.all_within(&field("rotation_deg"), &o.rotation_deg, -360.0..=360.0)?;
    check.within(&field("scale"), o.scale, 1e-6..=1e6)?;
    check.within(&field("albedo"), o.albedo, 0.0..=1.0)?;
    let size = 1e-6..=1e9;
    let shape = |name: &str| format!("{at}.shape.{name}");
    match &o.shape {
        Shape::Plane { size_mm } => match size_mm {
            Some(sides) => check.all_within(&shape("size_mm"), sides, size),
            None => Ok(()),
        },
        Shape::Sphere { radius_mm } => check.within(&shape("radius_mm"), *radius_mm, size),
        Shape::Cylinder {
            radius_mm,
            length_mm,
        } => {
            check.within(&shape("radius_mm"), *radius_mm, size.clone())?;
            check.within(&shape("length_mm"), *length_mm, size)
        }
        Shape::Frustum {
            base_mm,
            top_mm,
            height_mm,
        } => {
            check.within(&shape("base_mm"), *base_mm, size.clone())?;
            check.within(&shape("top_mm"), *top_mm, 0.0..=1e9)?;
            check.within(&shape("height_mm"), *height_mm, size)
        }
        Shape::Torso {
            seed,
            length_mm,
            width_mm,
            depth_mm,
            triangles,
        } => shapes::Torso {
            seed: *seed,
            length_mm: *length_mm,
            width_mm: *width_mm,
            depth_mm: *depth_mm,
            triangles: *triangles,
        }
        .check()
        .map_err(|(name, found, allowed)| check.source.violation(&shape(name), found, allowed)),
        Shape::Couch {} => Ok(()),
        Shape::Mesh { file } => check.that(
            !file.as_os_str().is_empty(),
            &shape("file"),
            "an empty path",
            "the path of an STL, OBJ or PLY file",
        ),
    }
}
