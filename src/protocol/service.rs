//! The service channel: what no physical scanner has. One line of JSON asks, for instance
//! `{"get":"truth"}` or `{"truth_at_ns":1500000000}`; one line of JSON answers, followed by as many bytes as it says. A connection
//! takes any number of requests, one after the other.
//!
//! `{"place":{"object":0,"position_mm":[0,0,900],"rotation_deg":[0,20,0]}}` takes an object elsewhere,
//! as if the scene file said so. It is done in order with exposures: frames that are under way are
//! finished first, and the next exposure sees the object where it is then. The answer, without maps,
//! comes when it is done. Refused are an object that is not there or moves along a path, and numbers
//! that a scene file may not have either; the scene stays as it was.
//!
//! Maps follow one another in the order of their names, each width * height little-endian f32 row
//! by row, then, where `flags` is true, one byte of flags a pixel.

use crate::error::{Error, Result};
use crate::pattern::manifest::MAX_SIDE_PX;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// Longest request or reply line in bytes.
pub const MAX_LINE: usize = 4096;
/// Most maps in a reply.
const MAX_MAPS: usize = 64;
/// Largest payload in bytes.
pub const MAX_PAYLOAD: u64 = 2 << 30;

/// What a client asks for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Request {
    /// Something of the emulator's inside.
    Get(Item),
    /// The truth at a device time in nanoseconds, of a scene that moves; [`Item::Truth`] is that of
    /// the middle of the last sequence.
    #[serde(rename = "truth_at_ns")]
    TruthAt(u64),
    /// Something that happens to the device.
    Do(Action),
    /// An object is taken to another place in the scene.
    Place(Placement),
}

/// Where an object of the scene is to be, as in a scene file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Which object, counted from 0 in the order of the scene file.
    pub object: u32,
    /// Its origin in the scene's frame in millimetres.
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis.
    pub rotation_deg: [f64; 3],
}

/// What can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Item {
    /// The truth behind the frames, over the whole sensor.
    Truth,
}

/// What can happen to a device from outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// A pulse on the external trigger input.
    Trigger,
}

impl Request {
    /// Reads a line.
    ///
    /// # Errors
    /// What is not a request, worded for the reply.
    pub fn parse(line: &[u8]) -> Result<Self, String> {
        serde_json::from_slice(line).map_err(|e| e.to_string())
    }

    /// The line with its newline.
    pub fn to_line(self) -> String {
        let mut line = serde_json::to_string(&self).expect("words and numbers");
        line.push('\n');
        line
    }
}

/// The line that answers.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reply {
    /// Why there is no answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Columns of each map.
    #[serde(default)]
    pub width: u32,
    /// Rows of each map.
    #[serde(default)]
    pub height: u32,
    /// The maps of f32 in order.
    #[serde(default)]
    pub maps: Vec<String>,
    /// Whether a map of bytes follows them.
    #[serde(default)]
    pub flags: bool,
    /// Microseconds that the device has spent on rendering frames since power-on.
    #[serde(default)]
    pub render_us: u64,
    /// Bytes that follow the line.
    #[serde(default)]
    pub bytes: u64,
}

impl Reply {
    /// The answer that there is none.
    pub fn refusal(why: impl std::fmt::Display) -> Self {
        Self {
            error: Some(why.to_string().chars().take(1000).collect()),
            ..Self::default()
        }
    }

    /// The line with its newline.
    pub fn to_line(&self) -> String {
        let mut line = serde_json::to_string(self).expect("numbers and strings");
        line.push('\n');
        line
    }

    /// Reads and checks a line.
    ///
    /// # Errors
    /// What is not a reply, contradicts itself or is beyond any bound.
    pub fn parse(line: &[u8]) -> Result<Self> {
        let bad = |what: String| Error::device(format!("service reply: {what}"));
        let reply: Self = serde_json::from_slice(line).map_err(|e| bad(e.to_string()))?;
        if reply.width > MAX_SIDE_PX || reply.height > MAX_SIDE_PX || reply.maps.len() > MAX_MAPS {
            return Err(bad(format!(
                "{} maps of {} x {}, want up to {MAX_MAPS} of up to {MAX_SIDE_PX} each",
                reply.maps.len(),
                reply.width,
                reply.height
            )));
        }
        let want = u64::from(reply.width) * u64::from(reply.height) * reply.bytes_per_pixel();
        if reply.bytes != want || want > MAX_PAYLOAD {
            return Err(bad(format!(
                "{} bytes, want {want} and at most {MAX_PAYLOAD}",
                reply.bytes
            )));
        }
        Ok(reply)
    }

    fn bytes_per_pixel(&self) -> u64 {
        4 * self.maps.len() as u64 + u64::from(self.flags)
    }
}

/// Named maps of one size.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Maps {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Name and width * height values, row by row.
    pub maps: Vec<(String, Vec<f32>)>,
    /// width * height bytes of flags.
    pub flags: Vec<u8>,
    /// See [`Reply::render_us`].
    pub render_us: u64,
}

impl Maps {
    /// The line and the payload that carry the maps.
    pub fn encode(&self) -> (Reply, Vec<u8>) {
        let mut payload: Vec<u8> = self
            .maps
            .iter()
            .flat_map(|(_, map)| map)
            .flat_map(|value| value.to_le_bytes())
            .collect();
        payload.extend_from_slice(&self.flags);
        let reply = Reply {
            error: None,
            width: self.width,
            height: self.height,
            maps: self.maps.iter().map(|(name, _)| name.clone()).collect(),
            flags: true,
            render_us: self.render_us,
            bytes: payload.len() as u64,
        };
        (reply, payload)
    }

    /// The maps of a checked reply and its payload.
    fn decode(reply: Reply, payload: &[u8]) -> Self {
        let pixels = reply.width as usize * reply.height as usize;
        let (floats, flags) = payload.split_at(4 * pixels * reply.maps.len());
        let mut chunks = floats
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        Self {
            width: reply.width,
            height: reply.height,
            maps: reply
                .maps
                .into_iter()
                .map(|name| (name, chunks.by_ref().take(pixels).collect()))
                .collect(),
            flags: flags.to_vec(),
            render_us: reply.render_us,
        }
    }
}

/// Sends a request over an open channel and reads the answer's maps. Timeouts are the stream's.
///
/// # Errors
/// What the system or the device refuses, and answers that are none.
pub fn ask(stream: &mut (impl Read + Write), request: Request) -> Result<Maps> {
    let io = |e| Error::io("service channel", e);
    stream.write_all(request.to_line().as_bytes()).map_err(io)?;
    let mut line = Vec::new();
    loop {
        let mut byte = [0];
        stream.read_exact(&mut byte).map_err(io)?;
        if byte[0] == b'\n' {
            break;
        }
        line.push(byte[0]);
        if line.len() > MAX_LINE {
            return Err(Error::device(format!(
                "service reply: a line longer than {MAX_LINE} bytes"
            )));
        }
    }
    let reply = Reply::parse(&line)?;
    if let Some(error) = reply.error {
        return Err(Error::device(format!("service channel: {error}")));
    }
    // Room is made as bytes come, not as they are promised.
    let mut payload = Vec::new();
    stream
        .take(reply.bytes)
        .read_to_end(&mut payload)
        .map_err(io)?;
    if payload.len() as u64 != reply.bytes {
        return Err(Error::device(format!(
            "service reply: ended after {} of {} bytes",
            payload.len(),
            reply.bytes
        )));
    }
    Ok(Maps::decode(reply, &payload))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A stream that answers with bytes made beforehand.
    struct Canned(std::io::Cursor<Vec<u8>>, Vec<u8>);

    impl Read for Canned {
        fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
            self.0.read(buf)
        }
    }
    impl Write for Canned {
        fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
            self.1.write(buf)
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn answer(bytes: Vec<u8>) -> Result<Maps> {
        ask(
            &mut Canned(std::io::Cursor::new(bytes), Vec::new()),
            Request::Get(Item::Truth),
        )
    }

    #[test]
    fn requests_have_the_shape_that_is_documented() {
        assert_eq!(Request::Get(Item::Truth).to_line(), "{\"get\":\"truth\"}\n");
        assert_eq!(
            Request::parse(b"{\"do\":\"trigger\"}"),
            Ok(Request::Do(Action::Trigger))
        );
        let at = Request::TruthAt(1_500_000_000);
        assert_eq!(at.to_line(), "{\"truth_at_ns\":1500000000}\n");
        assert_eq!(Request::parse(at.to_line().as_bytes()), Ok(at));
        let place = Request::Place(Placement {
            object: 1,
            position_mm: [0.1, 0.0, 1000.0],
            rotation_deg: [0.0, -20.5, 180.0],
        });
        let line = "{\"place\":{\"object\":1,\"position_mm\":[0.1,0.0,1000.0],\
            \"rotation_deg\":[0.0,-20.5,180.0]}}\n";
        assert_eq!(place.to_line(), line);
        assert_eq!(Request::parse(line.as_bytes()), Ok(place));
        for bad in [
            "",
            "{",
            "{\"truth_at_ns\":-1}",
            "{\"truth_at_ns\":1.5}",
            "{\"get\":\"moon\"}",
            "{\"get\":\"truth\",\"x\":1}",
            "{\"place\":{\"object\":0,\"position_mm\":[0,0,1]}}",
            "{\"place\":{\"object\":-1,\"position_mm\":[0,0,1],\"rotation_deg\":[0,0,0]}}",
            "{\"place\":{\"object\":0,\"position_mm\":[0,0,null],\"rotation_deg\":[0,0,0]}}",
            "{\"place\":{\"object\":0,\"position_mm\":[0,0,1e999],\"rotation_deg\":[0,0,0]}}",
            "[]",
        ] {
            assert!(Request::parse(bad.as_bytes()).is_err(), "{bad}");
        }
    }

    #[test]
    fn maps_go_round_with_their_nans() {
        let maps = Maps {
            width: 3,
            height: 2,
            maps: vec![
                ("depth_mm".into(), vec![1.0, 2.5, f32::NAN, -3.0, 0.0, 1e9]),
                ("projector_x".into(), vec![0.5; 6]),
            ],
            flags: vec![1, 2, 3, 4, 5, 6],
            render_us: 1234,
        };
        let (reply, payload) = maps.encode();
        let mut bytes = reply.to_line().into_bytes();
        bytes.extend_from_slice(&payload);
        let back = answer(bytes.clone()).unwrap();
        assert_eq!(back.encode(), maps.encode(), "the same bytes");
        bytes.pop();
        assert!(answer(bytes).unwrap_err().to_string().contains("53 of 54"));
        let refusal = Reply::refusal("no").to_line().into_bytes();
        assert!(answer(refusal).unwrap_err().to_string().contains("no"));
    }

    #[test]
    fn a_reply_may_not_promise_the_moon() {
        for bad in [
            "{\"width\":99999999,\"height\":1,\"maps\":[\"a\"],\"bytes\":399999996}",
            "{\"width\":2,\"height\":1,\"maps\":[\"a\"],\"bytes\":9}",
            "{\"width\":32768,\"height\":32768,\"maps\":[\"a\",\"b\"],\"bytes\":8589934592}",
        ] {
            assert!(Reply::parse(bad.as_bytes()).is_err(), "{bad}");
        }
        assert!(answer(vec![b'x'; 10_000]).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = Request::parse(&bytes);
            prop_assert!(answer(bytes).is_err());
        }
    }
}
