//! Camera of a profile: optics, timing and output format.

use super::lens::{check_distortion, check_glare};
use super::{Glare, PIXEL_ASPECT, Sensor, Vignetting, vignetting};
use glam::DVec2;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::{Lens, Pose, View};
use phasmid_pattern::manifest::MAX_SIDE_PX;
use phasmid_protocol::{PixelFormat, data_line};
use serde::{Deserialize, Serialize};

/// Maximum line time; real sensors need a few microseconds.
const MAX_LINE_TIME_US: f64 = 1000.0;

/// Optics and timing of the camera, whose frame is the rig's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Focal length of the lens in millimetres.
    pub focal_length_mm: f64,
    /// Width of the sensor's active area in millimetres.
    pub sensor_width_mm: f64,
    /// Width of a pixel over its height, 0.5 to 2, which is fy / fx of a calibration: a lens has one
    /// focal length in millimetres, and fx and fy are that length in pixel widths and heights.
    #[serde(default = "square")]
    pub pixel_aspect: f64,
    /// Principal point in pixels; the image's centre when absent.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly_if_any")]
    pub principal_point_px: Option<[f64; 2]>,
    /// OpenCV's k1 k2 p1 p2 k3.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub distortion: [f64; 5],
    /// Working f-number; determines the light that reaches the sensor and the defocus blur.
    #[serde(default = "f_number")]
    pub f_number: f64,
    /// Light falloff towards the edge of the image; none when absent.
    #[serde(default)]
    pub vignetting: Vignetting,
    /// Distance of the focal plane from the pupil in millimetres; everything is in focus when
    /// absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focus_mm: Option<f64>,
    /// Pixel format on the link at power-on.
    #[serde(default = "format")]
    pub format: PixelFormat,
    /// Adds a row above each image, on every link, that carries the frame's identity and metadata.
    #[serde(default)]
    pub data_line: bool,
    /// Exposure at power-on in microseconds.
    #[serde(default = "exposure_us")]
    pub exposure_us: f64,
    /// Minimum and maximum exposure in microseconds.
    #[serde(
        default = "exposure_range_us",
        deserialize_with = "phasmid_core::numbers::exactly"
    )]
    pub exposure_range_us: [f64; 2],
    /// Maximum gain in decibels above the sensor's base gain; the gain is 0 dB at power-on.
    #[serde(default = "max_gain_db")]
    pub max_gain_db: f64,
    /// Interval of free-running frames in microseconds.
    #[serde(default = "frame_interval_us")]
    pub frame_interval_us: f64,
    /// Line time of a rolling shutter in microseconds, as stated in CMOS data sheets: row r of the
    /// readout region starts its exposure r line times after the first row, and reading the frame
    /// takes one line time per row. 0 or absent means a global shutter. Rounded to nanoseconds.
    #[serde(default)]
    pub line_time_us: f64,
    /// Readout time of a full frame with a global shutter, in microseconds: once the frame has been
    /// read, it leaves the camera and the next exposure may start. A region of interest takes time
    /// in proportion to its rows. Zero when absent; for a rolling shutter use `line_time_us`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readout_us: Option<f64>,
    /// Minimum time in microseconds between the starts of consecutive frames, regardless of
    /// exposure; no minimum when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shortest_interval_us: Option<f64>,
    /// Veiling glare of the lens.
    #[serde(default)]
    pub glare: Option<Glare>,
    /// The sensor.
    #[serde(default)]
    pub sensor: Sensor,
}

/// The aspect ratio of square pixels.
fn square() -> f64 {
    1.0
}

fn f_number() -> f64 {
    4.0
}
fn format() -> PixelFormat {
    PixelFormat::Grey
}
fn exposure_us() -> f64 {
    10_000.0
}
fn exposure_range_us() -> [f64; 2] {
    [50.0, 500_000.0]
}
fn max_gain_db() -> f64 {
    24.0
}
/// The interval for 30 frames per second.
fn frame_interval_us() -> f64 {
    33_333.0
}

impl Camera {
    /// Returns intrinsics and pose; the pose is the identity because the rig's frame is the
    /// camera's.
    pub fn view(&self) -> View {
        let focal_px = self.focal_length_mm / self.pixel_pitch_mm();
        View {
            lens: Lens {
                width_px: self.width_px,
                height_px: self.height_px,
                focal_px: focal_px * DVec2::new(1.0, self.pixel_aspect),
                principal_px: self.principal_point_px.map_or(
                    DVec2::new(
                        (f64::from(self.width_px) - 1.0) / 2.0,
                        (f64::from(self.height_px) - 1.0) / 2.0,
                    ),
                    DVec2::from_array,
                ),
                distortion: self.distortion,
            },
            rig_from_view: Pose::IDENTITY,
        }
    }

    /// Returns the line time in nanoseconds.
    pub fn line_time_ns(&self) -> u64 {
        (self.line_time_us * 1e3).round() as u64
    }

    /// Returns the readout time of a full frame with a global shutter, in nanoseconds.
    pub fn readout_ns(&self) -> u64 {
        (self.readout_us.unwrap_or(0.0) * 1e3).round() as u64
    }

    /// Returns the minimum time between the starts of consecutive frames, in nanoseconds.
    pub fn shortest_interval_ns(&self) -> u64 {
        (self.shortest_interval_us.unwrap_or(0.0) * 1e3).round() as u64
    }

    /// Returns the minimum frame period in microseconds at the power-on exposure: no row starts its
    /// next exposure before its previous one has ended and all rows have been read.
    pub fn shortest_period_us(&self) -> f64 {
        let rolling_ns = self.line_time_ns() * u64::from(self.height_px);
        let least_ns = rolling_ns.max(self.shortest_interval_ns());
        (self.exposure_us + self.readout_ns() as f64 / 1e3).max(least_ns as f64 / 1e3)
    }

    /// Returns the width of a pixel, the pitch of the columns, in millimetres.
    pub fn pixel_pitch_mm(&self) -> f64 {
        self.sensor_width_mm / f64::from(self.width_px)
    }

    /// Returns the area of a pixel in square metres.
    pub fn pixel_area_m2(&self) -> f64 {
        (self.pixel_pitch_mm() * 1e-3).powi(2) / self.pixel_aspect
    }
}

pub(super) fn check(c: &Camera, check: &Check<'_>) -> Result<()> {
    check.section(|check| super::sensor::check(&c.sensor, c.format, check));
    check.within("camera.width_px", c.width_px, 8..=MAX_SIDE_PX)?;
    check.within("camera.height_px", c.height_px, 8..=MAX_SIDE_PX)?;
    check.within("camera.focal_length_mm", c.focal_length_mm, 0.1..=10_000.0)?;
    check.within("camera.sensor_width_mm", c.sensor_width_mm, 0.1..=1000.0)?;
    check.within("camera.pixel_aspect", c.pixel_aspect, PIXEL_ASPECT)?;
    if let Some(point) = c.principal_point_px {
        check.all_within("camera.principal_point_px", &point, -1e6..=1e6)?;
    }
    check.within("camera.f_number", c.f_number, 0.5..=128.0)?;
    if let Some(focus) = c.focus_mm {
        let focal_length = format!(" for camera.focal_length_mm = {}", c.focal_length_mm);
        check.within_for(
            "camera.focus_mm",
            focus,
            c.focal_length_mm..=1e9,
            &focal_length,
        )?;
    }
    if let Some(glare) = c.glare {
        check_glare(glare, check)?;
    }
    let [shortest, longest] = c.exposure_range_us;
    check.all_within("camera.exposure_range_us", &[shortest, longest], 0.1..=60e6)?;
    check.within("camera.max_gain_db", c.max_gain_db, 0.0..=60.0)?;
    check.within(
        "camera.line_time_us",
        c.line_time_us,
        0.0..=MAX_LINE_TIME_US,
    )?;
    for (field, us) in [
        ("camera.readout_us", c.readout_us),
        ("camera.shortest_interval_us", c.shortest_interval_us),
    ] {
        check.within(field, us.unwrap_or(0.0), 0.0..=60e6)?;
    }
    let pixels = u64::from(c.width_px) * u64::from(c.height_px);
    check.that(
        pixels <= 1 << 26,
        "camera.height_px",
        format!("{pixels} pixels in all"),
        "up to 67108864 pixels",
    )?;
    check_distortion(&c.view().lens, "camera.distortion", check)?;
    vignetting::check(&c.vignetting, &c.view().lens, "camera.vignetting", check)?;
    check.that(
        shortest <= longest,
        "camera.exposure_range_us",
        format!("[{shortest}, {longest}]"),
        "the shorter exposure first",
    )?;
    let exposures = format!("[{shortest}, {longest}]");
    let exposures = check.given("camera.exposure_range_us", exposures);
    check.within_for(
        "camera.exposure_us",
        c.exposure_us,
        shortest..=longest,
        &format!(" for camera.exposure_range_us = {exposures}"),
    )?;
    check.that(
        c.line_time_ns() == 0 || c.readout_ns() == 0,
        "camera.readout_us",
        format!(
            "a readout time together with line_time_us = {}",
            c.line_time_us
        ),
        "0 for one of them: a rolling shutter's rows are read line by line",
    )?;
    check.within_for(
        "camera.frame_interval_us",
        c.frame_interval_us,
        c.shortest_period_us().max(100.0)..=60e6,
        &format!(
            ": no shorter than camera.exposure_us = {} and the readout",
            c.exposure_us
        ),
    )?;
    check.that(
        c.format != PixelFormat::Yuyv || c.width_px.is_multiple_of(2),
        "camera.format",
        format!("YUYV of {} columns", c.width_px),
        "GREY, or an even width_px: YUYV holds pairs of pixels",
    )?;
    if !c.data_line {
        return Ok(());
    }
    check.that(
        c.width_px >= data_line::WIDTH_PX,
        "camera.data_line",
        format!("a data line above {} columns", c.width_px),
        format!("false, or a width_px of {} or more", data_line::WIDTH_PX),
    )?;
    // The data line reports the time from the start of the first row's exposure to the end of the
    // last row's.
    let skew_ns = c.line_time_ns() * u64::from(c.height_px - 1);
    let longest_told_us = (data_line::MAX_EXPOSURE_NS.saturating_sub(skew_ns)) as f64 / 1e3;
    check.that(
        longest <= longest_told_us,
        "camera.data_line",
        format!("a data line, and exposures of up to {longest} us"),
        format!("false, or exposures of up to {longest_told_us} us: the line has no room for more"),
    )
}
