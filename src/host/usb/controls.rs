//! Exposure and gain controls of the USB video class.

use super::device::UsbDevice;
use super::topology::{long, word};
use super::video::VideoFunction;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::Setup;
use phasmid_protocol::usb::uvc::{request, selector};
use std::ops::RangeInclusive;

/// A control of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VideoControl {
    /// Exposure time in units of 100 us.
    Exposure,
    /// Gain in device-specific units.
    Gain,
}

/// Range and current value of a control.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ControlState {
    /// Minimum and maximum value.
    pub range: RangeInclusive<u32>,
    /// Step size.
    pub step: u32,
    /// Value at power-on.
    pub default: u32,
    /// Current value.
    pub current: u32,
}

impl VideoControl {
    fn name(self) -> &'static str {
        match self {
            Self::Exposure => "exposure",
            Self::Gain => "gain",
        }
    }

    /// Returns value, index and length of requests to this control; `None` if the camera does not
    /// have it.
    fn address(self, function: &VideoFunction) -> Option<(u16, u16, u16)> {
        let (entity, selector, len) = match self {
            Self::Exposure => (
                function.exposure_entity,
                selector::EXPOSURE_TIME_ABSOLUTE,
                4,
            ),
            Self::Gain => (function.gain_entity, selector::GAIN, 2),
        };
        let index = u16::from(entity?) << 8 | u16::from(function.control);
        Some((u16::from(selector) << 8, index, len))
    }

    /// Reads the control; returns `None` if the camera does not have it.
    ///
    /// # Errors
    /// Returns an error if the camera refuses, does not answer, or is gone.
    pub fn read(
        self,
        device: &UsbDevice,
        function: &VideoFunction,
    ) -> Result<Option<ControlState>> {
        let Some((value, index, len)) = self.address(function) else {
            return Ok(None);
        };
        let get = |request| -> Result<u32> {
            let bytes = device.get(Setup::CLASS_IN, request, value, index, len)?;
            if bytes.len() != usize::from(len) {
                return Err(Error::device(format!(
                    "{}: {} returned {} bytes, expected {len}",
                    device.place(),
                    self.name(),
                    bytes.len()
                )));
            }
            Ok(if len == 4 {
                long(&bytes, 0)
            } else {
                word(&bytes, 0).into()
            })
        };
        Ok(Some(ControlState {
            range: get(request::GET_MIN)?..=get(request::GET_MAX)?,
            step: get(request::GET_RES)?,
            default: get(request::GET_DEF)?,
            current: get(request::GET_CUR)?,
        }))
    }

    /// Sets the control.
    ///
    /// # Errors
    /// Returns an error if the camera lacks the control, refuses the value, does not answer, or is
    /// gone.
    pub fn write(self, device: &UsbDevice, function: &VideoFunction, to: u32) -> Result<()> {
        let Some((value, index, len)) = self.address(function) else {
            let place = device.place();
            return Err(Error::device(format!(
                "{place}: the camera has no {} control",
                self.name()
            )));
        };
        let bytes = to.to_le_bytes();
        if len == 2 && to > u16::MAX.into() {
            return Err(Error::input(self.name(), to, "0 to 65535"));
        }
        let data = &bytes[..len.into()];
        device.set(Setup::CLASS_OUT, request::SET_CUR, value, index, data)
    }
}
