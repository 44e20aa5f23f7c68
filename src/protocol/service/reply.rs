//! The header line of a reply, and the note of a recording in the same form.

use super::about::{
    Clock, DeviceAbout, FaultsAbout, FrameAbout, Objects, SequenceAbout, TermAbout,
};
use super::{MAX_MAPS, MAX_PAYLOAD};
use phasmid_core::error::{Error, Result};
use phasmid_pattern::manifest::MAX_SIDE_PX;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The line that answers a request.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Reply {
    /// Reason for a refusal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Columns of each map.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub width: u32,
    /// Rows of each map.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub height: u32,
    /// Names of the f32 maps, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<String>,
    /// Whether a byte map follows the f32 maps.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub flags: bool,
    /// Time spent rendering frames since power-on, in microseconds.
    #[serde(default)]
    pub render_us: u64,
    /// Number of bytes that follow the line.
    #[serde(default)]
    pub bytes: u64,
    /// Clock state, in replies to clock requests.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// The requested frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<FrameAbout>,
    /// Scene state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<Objects>,
    /// Device state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<DeviceAbout>,
    /// Id of the added fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<u64>,
    /// Fault state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub faults: Option<FaultsAbout>,
    /// The selected sequence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceAbout>,
    /// The calibration that the device reports, in TOML.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// The fields of the scene, as in a scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fields: Option<Value>,
    /// The terms of image formation, in the order of the passes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plan: Vec<TermAbout>,
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}

impl Reply {
    /// Creates a refusal with its reason.
    pub fn refusal(why: impl std::fmt::Display) -> Self {
        Self {
            error: Some(why.to_string().chars().take(1000).collect()),
            ..Self::default()
        }
    }

    /// Serializes the line, including its newline.
    pub fn to_line(&self) -> String {
        let mut line = serde_json::to_string(self).expect("numbers and strings");
        line.push('\n');
        line
    }

    /// Parses and validates a line.
    ///
    /// # Errors
    /// Returns an error if the line is not a reply, is inconsistent, or exceeds a limit.
    pub fn parse(line: &[u8]) -> Result<Self> {
        let bad = |what: String| Error::device(format!("service reply: {what}"));
        let reply: Self = serde_json::from_slice(line).map_err(|e| bad(e.to_string()))?;
        if reply.width > MAX_SIDE_PX || reply.height > MAX_SIDE_PX || reply.maps.len() > MAX_MAPS {
            return Err(bad(format!(
                "{} maps of {} x {}, expected up to {MAX_MAPS} of up to {MAX_SIDE_PX} each",
                reply.maps.len(),
                reply.width,
                reply.height
            )));
        }
        let want = u64::from(reply.width) * u64::from(reply.height) * reply.bytes_per_pixel();
        if reply.bytes != want || want > MAX_PAYLOAD {
            return Err(bad(format!(
                "{} bytes, expected {want} and at most {MAX_PAYLOAD}",
                reply.bytes
            )));
        }
        Ok(reply)
    }

    fn bytes_per_pixel(&self) -> u64 {
        4 * self.maps.len() as u64 + u64::from(self.flags)
    }
}

impl SequenceAbout {
    /// Returns the note that a recording keeps of a sequence and of the calibration: one line in the
    /// form of the service channel's replies.
    pub fn to_note(&self, calibration: Option<String>) -> String {
        let reply = Reply {
            sequence: Some(self.clone()),
            calibration,
            ..Reply::default()
        };
        reply.to_line().trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reply_without_maps_has_no_fields_of_maps() {
        let reply = Reply {
            fault: Some(3),
            ..Reply::default()
        };
        let line = reply.to_line();
        assert_eq!(line, "{\"render_us\":0,\"bytes\":0,\"fault\":3}\n");
        assert_eq!(Reply::parse(line.as_bytes()).unwrap(), reply);
        let all = "{\"width\":0,\"height\":0,\"maps\":[],\"flags\":false,\"render_us\":0,\
                   \"bytes\":0,\"fault\":3}";
        assert_eq!(Reply::parse(all.as_bytes()).unwrap(), reply);
        assert_eq!(Reply::parse(b"{}").unwrap(), Reply::default());
    }

    #[test]
    fn refuses_reply_with_impossible_sizes() {
        for bad in [
            "{\"width\":99999999,\"height\":1,\"maps\":[\"a\"],\"bytes\":399999996}",
            "{\"width\":2,\"height\":1,\"maps\":[\"a\"],\"bytes\":9}",
            "{\"width\":32768,\"height\":32768,\"maps\":[\"a\",\"b\"],\"bytes\":8589934592}",
        ] {
            assert!(Reply::parse(bad.as_bytes()).is_err(), "{bad}");
        }
    }
}
