//! `CAMera`: exposure, gain, format, region and frame interval.

use super::form::{Setting, numeric};
use super::{Answer, MAX_TIME_S, say};
use crate::Roi;
use crate::firmware::Firmware;
use crate::firmware::settings::{Settings, from_seconds, seconds};
use crate::firmware::table::Command;
use phasmid_protocol::scpi::{Args, DeviceError, ErrorCode, Number, Quantity, Unit};
use phasmid_protocol::{PixelFormat, data_line};

/// Shortest interval of free-running frames in seconds.
const MIN_INTERVAL_S: f64 = 1e-4;

impl Firmware {
    pub(super) fn camera(&mut self, unit: &Unit, command: Command) -> Answer {
        let camera = &self.profile.camera;
        let settings = &self.settings;
        if !unit.query {
            self.not_running()?;
        }
        match command {
            Command::Exposure => {
                let [shortest, longest] = camera.exposure_range_us;
                // `MAX` stands for the longest exposure that the period allows; a longer exposure
                // within the camera's range is a settings conflict.
                let longest = match Args::new(&unit.params).number(Quantity::Time) {
                    Ok(Number::Max) => {
                        let room_ns = settings.period_ns.saturating_sub(settings.readout_ns());
                        seconds(room_ns).min(longest / 1e6)
                    }
                    _ => longest / 1e6,
                };
                let bounds = (shortest / 1e6, longest, camera.exposure_us / 1e6);
                match numeric(unit, Quantity::Time, seconds(settings.exposure_ns), bounds)? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => {
                        let exposure_ns = from_seconds(value);
                        let settings = Settings {
                            exposure_ns,
                            ..settings.clone()
                        };
                        self.check_selected(&settings)?;
                        self.apply(settings)?;
                    }
                }
            }
            Command::Gain => {
                let bounds = (0.0, camera.max_gain_db, 0.0);
                match numeric(unit, Quantity::Decibel, settings.gain_db, bounds)? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => self.settings.gain_db = value,
                }
            }
            Command::Interval => {
                let default = camera.frame_interval_us / 1e6;
                let bounds = (MIN_INTERVAL_S, MAX_TIME_S, default);
                match numeric(unit, Quantity::Time, seconds(settings.interval_ns), bounds)? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => self.apply(Settings {
                        interval_ns: from_seconds(value),
                        ..settings.clone()
                    })?,
                }
            }
            Command::Format => {
                if unit.query {
                    return say(settings.format.name());
                }
                let formats = camera.sensor.formats().iter();
                let choices: Vec<_> = formats.map(|format| (format.name(), *format)).collect();
                let mut args = Args::new(&unit.params);
                let format = args.choice(&choices)?;
                args.finish()?;
                if !settings.roi.width.is_multiple_of(columns(format)) {
                    return Err(ErrorCode::SettingsConflict.with(format!(
                        "CAMera:ROI is {} columns wide, {} holds pairs of them",
                        settings.roi.width,
                        format.name()
                    )));
                }
                self.apply(Settings {
                    format,
                    ..settings.clone()
                })?;
            }
            _ if unit.query => {
                let roi = settings.roi;
                return say(format!("{},{},{},{}", roi.x, roi.y, roi.width, roi.height));
            }
            _ => {
                let settings = Settings {
                    roi: self.region(unit)?,
                    ..self.settings.clone()
                };
                self.check_selected(&settings)?;
                self.apply(settings)?;
            }
        }
        Ok(None)
    }

    /// Parses x, y, width and height of a region. The region must lie inside the sensor, leave room
    /// for the data line and consist of whole pixel pairs where the format requires them.
    fn region(&self, unit: &Unit) -> Result<Roi, DeviceError> {
        let camera = &self.profile.camera;
        let group = columns(self.settings.format);
        let narrowest = if camera.data_line {
            data_line::WIDTH_PX
        } else {
            group
        };
        let mut args = Args::new(&unit.params);
        let mut next = |min: u32, max: u32, default: u32| {
            args.number(Quantity::Plain)?
                .within(f64::from(min), f64::from(max), f64::from(default))
                .map(|value| value.round() as u32)
        };
        let x = next(0, camera.width_px - narrowest, 0)?;
        let y = next(0, camera.height_px - 1, 0)?;
        let widest = (camera.width_px - x) / group * group;
        let width = next(narrowest, widest, widest)?;
        let highest = camera.height_px - y;
        let height = next(1, highest, highest)?;
        args.finish()?;
        if !width.is_multiple_of(group) {
            return Err(ErrorCode::DataOutOfRange.with(format!(
                "{width} columns, allowed even numbers: YUYV holds pairs of them"
            )));
        }
        Ok(Roi {
            x,
            y,
            width,
            height,
        })
    }
}

/// Returns the number of which a region's width must be a multiple, since packed formats pad their
/// rows.
fn columns(format: PixelFormat) -> u32 {
    match format {
        PixelFormat::Yuyv => 2,
        _ => 1,
    }
}
