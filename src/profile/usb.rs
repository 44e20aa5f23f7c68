//! USB enumeration of a device: `[usb]` of a profile.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// USB properties of a scanner; every field is optional. The string descriptors come from the
/// identity: manufacturer, model and serial number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Usb {
    /// Vendor id. Defaults to 0x1209, which belongs to pid.codes.
    pub vendor_id: u16,
    /// Product id. Defaults to 0x0001, which pid.codes reserves for tests.
    pub product_id: u16,
    /// Release of the device, binary coded decimal: 0x0100 is 1.00.
    pub release_bcd: u16,
    /// Speed of the USB link.
    pub speed: Speed,
    /// Maximum current draw in milliamperes.
    pub max_power_ma: u32,
    /// Transfer type of frames.
    pub transfer: Transfer,
    /// Effect of a rising edge of the host's RTS line.
    pub rts: RtsUse,
    /// Meaning of the device's DSR line.
    pub dsr: DsrUse,
}

impl Default for Usb {
    fn default() -> Self {
        Self {
            vendor_id: 0x1209,
            product_id: 0x0001,
            release_bcd: 0x0100,
            speed: Speed::High,
            max_power_ma: 500,
            transfer: Transfer::Bulk,
            rts: RtsUse::None,
            dsr: DsrUse::Ready,
        }
    }
}

/// Speeds of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Speed {
    /// 480 Mbit/s, USB 2.0.
    High,
    /// 5 Gbit/s, USB 3.
    Super,
}

/// Transfer type of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Transfer {
    /// Bulk transfers: as fast as the link allows, without loss.
    Bulk,
    /// Isochronous transfers: packets at fixed intervals, as in most webcams.
    Isochronous,
}

/// Effect of a rising edge of RTS.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum RtsUse {
    /// Nothing.
    None,
    /// Acts as a pulse on the external trigger input.
    Trigger,
}

/// Meaning of DSR.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum DsrUse {
    /// The device is on.
    Ready,
    /// A sequence is being projected: the projector's sync output.
    Sync,
}

/// Rejects values that the types allow but USB does not.
pub(super) fn check(usb: &Usb, check: &Check<'_>) -> Result<()> {
    // The descriptor stores the current in one byte, in units of 2 mA at high speed and 8 mA at
    // SuperSpeed.
    let most = match usb.speed {
        Speed::High => 500,
        Speed::Super => 900,
    };
    check.within("usb.max_power_ma", usb.max_power_ma, 2..=most)?;
    let digits = (0..4).all(|i| usb.release_bcd >> (4 * i) & 0xF <= 9);
    check.that(
        digits,
        "usb.release_bcd",
        format!("{:#06x}", usb.release_bcd),
        "four decimal digits, one in each half byte",
    )
}
