//! Negotiation of a video stream: probe, commit, and the choice of endpoint.

use super::device::UsbDevice;
use super::topology::{Endpoint, TransferKind};
use super::video::{VideoFunction, VideoMode};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::Setup;
use phasmid_protocol::usb::usbip::MAX_TRANSFER;
use phasmid_protocol::usb::uvc::{Negotiation, request, selector};

/// Maximum size of a frame, in bytes.
const MAX_FRAME: u64 = 256 << 20;
/// Maximum size of a bulk transfer, in bytes; a longer payload takes several.
const BULK_TRANSFER: u32 = 64 << 10;
/// Number of packets in an isochronous transfer: 4 ms at high speed.
const PACKETS: u32 = 32;
/// Length in bytes of the probe and commit structure from UVC 1.5 on.
const LONG_LEN: usize = 48;

/// How the stream is transferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Carrier {
    /// Endpoint address.
    pub(super) address: u8,
    /// Size of a transfer, in bytes.
    pub(super) transfer_len: u32,
    /// Number of packets in a transfer; `None` for bulk.
    pub(super) packets: Option<u32>,
    pub(super) max_payload: usize,
    pub(super) frame_len: usize,
}

/// Probes and commits a mode, and selects the alternate setting.
pub(super) fn agree(
    device: &UsbDevice,
    function: &VideoFunction,
    mode: &VideoMode,
) -> Result<Carrier> {
    let bad = |what: String| Error::device(format!("{}: {what}", device.place()));
    let frame_len = mode.frame_len();
    if frame_len > MAX_FRAME {
        return Err(bad(format!(
            "frames of {frame_len} bytes; expected at most {MAX_FRAME}"
        )));
    }
    let wanted = Negotiation {
        // Keep the frame interval fixed; the device may adapt the other fields.
        hint: 1,
        format: mode.format_index,
        frame: mode.frame_index,
        interval: mode.default_interval,
        max_frame: 0,
        max_payload: 0,
        clock: 0,
    };
    let talk = Talk { device, function };
    talk.set(selector::PROBE, &wanted)?;
    let agreed = talk.get(selector::PROBE)?;
    if (agreed.format, agreed.frame) != (mode.format_index, mode.frame_index) {
        return Err(bad(format!(
            "asked for format {} and frame {}, the camera offers {} and {}",
            mode.format_index, mode.frame_index, agreed.format, agreed.frame
        )));
    }
    if agreed.max_payload == 0 {
        return Err(bad("the camera requests payloads of 0 bytes".to_owned()));
    }
    talk.set(selector::COMMIT, &agreed)?;
    let carrier = |endpoint: &Endpoint, transfer_len, packets| Carrier {
        address: endpoint.address,
        transfer_len,
        packets,
        max_payload: agreed.max_payload as usize,
        frame_len: frame_len as usize,
    };
    let need = agreed.max_payload;
    let enough = |c: &&(u8, Endpoint)| c.1.bytes_per_interval >= need;
    let bulk = function
        .carriers
        .iter()
        .find(|c| c.1.kind == TransferKind::Bulk);
    if let Some((_, endpoint)) = bulk {
        // Make the transfer a multiple of the packet size: if its last packet were shorter, it
        // could not be distinguished from the short packet that ends a payload.
        let packet = u32::from(endpoint.max_packet);
        let len = need.min(BULK_TRANSFER).next_multiple_of(packet);
        return Ok(carrier(endpoint, len, None));
    }
    let Some((setting, endpoint)) = function.carriers.iter().find(enough) else {
        return Err(bad(format!(
            "no setting of the camera carries payloads of {need} bytes"
        )));
    };
    device.set_interface(function.streaming, *setting)?;
    let packets = PACKETS.min(MAX_TRANSFER / endpoint.bytes_per_interval);
    let len = packets * endpoint.bytes_per_interval;
    Ok(carrier(endpoint, len, Some(packets)))
}

struct Talk<'a> {
    device: &'a UsbDevice,
    function: &'a VideoFunction,
}

impl Talk<'_> {
    fn len(&self) -> usize {
        match self.function.uvc_bcd {
            ..0x0110 => Negotiation::SHORT_LEN,
            0x0110..0x0150 => Negotiation::LEN,
            _ => LONG_LEN,
        }
    }

    fn set(&self, selector: u8, wanted: &Negotiation) -> Result<()> {
        let mut bytes = wanted.encode().to_vec();
        bytes.resize(self.len(), 0);
        let (value, index) = (u16::from(selector) << 8, self.function.streaming.into());
        self.device
            .set(Setup::CLASS_OUT, request::SET_CUR, value, index, &bytes)
    }

    fn get(&self, selector: u8) -> Result<Negotiation> {
        let (value, index) = (u16::from(selector) << 8, self.function.streaming.into());
        let len = self.len();
        let bytes = self
            .device
            .get(Setup::CLASS_IN, request::GET_CUR, value, index, len as u16)?;
        let known = &bytes[..bytes.len().min(Negotiation::LEN)];
        Negotiation::decode(known).ok_or_else(|| {
            Error::device(format!(
                "{}: the camera's negotiation data have {} bytes, expected {len}",
                self.device.place(),
                bytes.len()
            ))
        })
    }
}
