//! How a device enumerates as a USB device: `[usb]` of a profile.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// The USB side of a scanner; every field may be left out. The strings are the identity's:
/// manufacturer, model and serial number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Usb {
    /// Vendor id. 0x1209, of pid.codes, as long as nothing else is said.
    pub vendor_id: u16,
    /// Product id. 0x0001, which pid.codes leaves for tests, as long as nothing else is said.
    pub product_id: u16,
    /// Release of the device, binary coded decimal: 0x0100 is 1.00.
    pub release_bcd: u16,
    /// Speed of its link.
    pub speed: Speed,
    /// Most current that it draws in milliamperes.
    pub max_power_ma: u32,
    /// How frames travel.
    pub transfer: Transfer,
    /// What a rising edge of the host's RTS line does.
    pub rts: RtsUse,
    /// What the device's DSR line tells.
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
#[serde(rename_all = "lowercase")]
pub enum Speed {
    /// 480 Mbit/s, USB 2.0.
    High,
    /// 5 Gbit/s, USB 3.
    Super,
}

/// How frames travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Transfer {
    /// As fast as the link goes, without loss.
    Bulk,
    /// In packets at fixed times, as most webcams do.
    Isochronous,
}

/// What a rising edge of RTS does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RtsUse {
    /// Nothing.
    None,
    /// It is a pulse on the external trigger input.
    Trigger,
}

/// What DSR tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DsrUse {
    /// The device is on.
    Ready,
    /// A sequence is being projected: the projector's sync output.
    Sync,
}

/// Checks what the types allow and USB does not.
pub(super) fn check(usb: &Usb, check: &Check<'_>) -> Result<()> {
    // Two milliamperes a step at high speed, eight at SuperSpeed, in one byte.
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
