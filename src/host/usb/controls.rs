//! Exposure and gain as the video class has them.

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
    /// Gain in units of the device's own.
    Gain,
}

/// What a control can be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ControlState {
    /// Least to most.
    pub range: RangeInclusive<u32>,
    /// Step.
    pub step: u32,
    /// At power-on.
    pub default: u32,
    /// Now.
    pub current: u32,
}

impl VideoControl {
    fn name(self) -> &'static str {
        match self {
            Self::Exposure => "exposure",
            Self::Gain => "gain",
        }
    }

    /// Value, index and length of the requests to it; `None` where the camera has no such control.
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

    /// Reads the control; `None` where the camera has none.
    ///
    /// # Errors
    /// A camera that refuses, is silent, or has gone.
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
                    "{}: {} is told in {} bytes, want {len}",
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
    /// A camera without it, one that refuses the value, is silent, or has gone.
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
