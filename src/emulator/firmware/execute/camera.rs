//! `CAMera`: exposure, gain, format, region and frame interval.

use super::setting::{Setting, numeric};
use super::{Answer, MAX_TIME_S, check_period, say};
use crate::emulator::Roi;
use crate::emulator::firmware::Firmware;
use crate::emulator::firmware::settings::{from_seconds, seconds};
use crate::emulator::firmware::table::Command;
use crate::protocol::scpi::{Args, DeviceError, Quantity, Unit};

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
                let bounds = (shortest / 1e6, longest / 1e6, camera.exposure_us / 1e6);
                match numeric(unit, Quantity::Time, seconds(settings.exposure_ns), bounds)? {
                    Setting::Say(value) => return say(value),
                    Setting::Set(value) => {
                        let exposure_ns = from_seconds(value);
                        check_period(exposure_ns, settings.period_ns)?;
                        self.settings.exposure_ns = exposure_ns;
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
                    Setting::Set(value) => self.settings.interval_ns = from_seconds(value),
                }
            }
            Command::Format => {
                let code = String::from_utf8_lossy(&camera.format.fourcc())
                    .trim_end()
                    .to_owned();
                if unit.query {
                    return say(code);
                }
                let mut args = Args::new(&unit.params);
                args.choice(&[(code.as_str(), ())])?;
                args.finish()?;
            }
            _ if unit.query => {
                let roi = settings.roi;
                return say(format!("{},{},{},{}", roi.x, roi.y, roi.width, roi.height));
            }
            _ => {
                let (width, height) = (camera.width_px, camera.height_px);
                self.settings.roi = roi(unit, width, height)?;
            }
        }
        Ok(None)
    }
}

/// x, y, width, height inside of the sensor.
fn roi(unit: &Unit, width: u32, height: u32) -> Result<Roi, DeviceError> {
    let mut args = Args::new(&unit.params);
    let mut next = |min: f64, max: u32, default: u32| {
        args.number(Quantity::Plain)?
            .within(min, f64::from(max), f64::from(default))
            .map(|value| value.round() as u32)
    };
    let x = next(0.0, width - 1, 0)?;
    let y = next(0.0, height - 1, 0)?;
    let w = next(1.0, width - x, width - x)?;
    let h = next(1.0, height - y, height - y)?;
    args.finish()?;
    Ok(Roi {
        x,
        y,
        width: w,
        height: h,
    })
}
