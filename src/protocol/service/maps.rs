//! Per-pixel maps, and the client side of the service channel.

use super::{MAX_REPLY_LINE, Reply, Request};
use phasmid_core::error::{Error, Result};
use std::io::{Read, Write};

/// Named maps of the same size.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Maps {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Names, each with width * height values in row-major order.
    pub maps: Vec<(String, Vec<f32>)>,
    /// Flags, width * height bytes.
    pub flags: Vec<u8>,
    /// Time spent rendering frames since power-on; see [`Reply::render_us`].
    pub render_us: u64,
}

impl Maps {
    /// Encodes the maps as a reply line and its payload.
    pub fn encode(&self) -> (Reply, Vec<u8>) {
        let mut payload: Vec<u8> = self
            .maps
            .iter()
            .flat_map(|(_, map)| map)
            .flat_map(|value| value.to_le_bytes())
            .collect();
        payload.extend_from_slice(&self.flags);
        let reply = Reply {
            width: self.width,
            height: self.height,
            maps: self.maps.iter().map(|(name, _)| name.clone()).collect(),
            flags: true,
            render_us: self.render_us,
            bytes: payload.len() as u64,
            ..Reply::default()
        };
        (reply, payload)
    }

    /// Decodes the maps of a validated reply and its payload.
    fn decode(reply: &Reply, payload: &[u8]) -> Self {
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
                .iter()
                .map(|name| (name.clone(), chunks.by_ref().take(pixels).collect()))
                .collect(),
            flags: flags.to_vec(),
            render_us: reply.render_us,
        }
    }
}

/// Sends a request over an open channel and reads the maps of the answer. The stream's timeouts
/// apply.
///
/// # Errors
/// Returns an error if the stream fails, the device refuses the request, or the answer is invalid.
pub fn ask(stream: &mut (impl Read + Write), request: Request) -> Result<Maps> {
    Ok(call(stream, &request)?.1)
}

/// Sends a request over an open channel and reads the answer. The stream's timeouts apply.
///
/// # Errors
/// Returns an error if the stream fails, the device refuses the request, or the answer is invalid.
pub fn call(stream: &mut (impl Read + Write), request: &Request) -> Result<(Reply, Maps)> {
    let io = |e| Error::io("service channel", e);
    stream.write_all(request.to_line().as_bytes()).map_err(io)?;
    let mut line = Vec::new();
    // Reads one byte at a time, so that no bytes after the line are consumed.
    loop {
        let mut byte = [0];
        stream.read_exact(&mut byte).map_err(io)?;
        if byte[0] == b'\n' {
            break;
        }
        line.push(byte[0]);
        if line.len() > MAX_REPLY_LINE {
            return Err(Error::device(format!(
                "service reply: a line longer than {MAX_REPLY_LINE} bytes"
            )));
        }
    }
    let reply = Reply::parse(&line)?;
    if let Some(error) = reply.error {
        return Err(Error::device(format!("service channel: {error}")));
    }
    // Memory grows with the bytes received, not with the announced length.
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
    let maps = Maps::decode(&reply, &payload);
    Ok((reply, maps))
}

#[cfg(test)]
mod tests {
    use super::super::Item;
    use super::*;
    use proptest::prelude::*;

    /// A stream that answers with prepared bytes.
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
    fn maps_with_nans_read_back_equal() {
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
    fn reply_line_beyond_the_limit_is_refused() {
        assert!(answer(vec![b'x'; MAX_REPLY_LINE + 10]).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            prop_assert!(answer(bytes).is_err());
        }
    }
}
