//! A camera behind a frame socket.

use super::Camera;
use crate::sockets::{self, UnixStream};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::admission::{ADMITTED, MAX_LINE, REFUSED, TOKEN_REQUIRED, Token};
use phasmid_protocol::wire::FrameDecoder;
use phasmid_protocol::{Frame, printable};
use std::collections::HashSet;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

enum Stream {
    Unix(UnixStream),
    Tcp(TcpStream),
}

impl Stream {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> std::io::Result<usize> {
        // A socket timeout of zero would mean no timeout.
        let timeout = Some(timeout.max(Duration::from_micros(1)));
        match self {
            Self::Unix(stream) => {
                stream.set_read_timeout(timeout)?;
                stream.read(buffer)
            }
            Self::Tcp(stream) => {
                stream.set_read_timeout(timeout)?;
                stream.read(buffer)
            }
        }
    }

    /// Reads at least one byte, or returns `None` after the timeout.
    ///
    /// # Errors
    /// Returns an error if the connection has been closed or has failed.
    fn read_some(
        &mut self,
        buffer: &mut [u8],
        timeout: Duration,
        address: &str,
    ) -> Result<Option<usize>> {
        let end = Instant::now() + timeout;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            return match self.read(buffer, left) {
                Ok(0) => Err(Error::device(format!(
                    "{address}: the camera has closed the connection"
                ))),
                Ok(len) => Ok(Some(len)),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    Ok(None)
                }
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) => Err(Error::io(address, e)),
            };
        }
    }
}

/// State before the first frame.
enum Opening {
    /// The device requires a token.
    TokenRequired,
    /// The token is right.
    Admitted,
    /// The received bytes are not a line: the first frame has begun.
    Frames,
}

/// A camera behind a frame socket, with the protocol of [`phasmid_protocol::wire`].
pub struct SocketCamera {
    stream: Stream,
    address: String,
    /// Lines may precede the first frame. These are the bytes read so far of such a line; `None`
    /// once frames have begun.
    opening: Option<Vec<u8>>,
    /// Kinds of lines received before the first frame.
    received: HashSet<[u8; 4]>,
    decoder: FrameDecoder,
    /// Set after a frame header was damaged: no byte that follows can be trusted.
    lost: bool,
    skipped: bool,
}

impl SocketCamera {
    /// Connects to a socket at a path; `place` names it in messages.
    pub(super) fn connect_unix(path: &str, address: &str, place: &str) -> Result<Self> {
        if path.is_empty() {
            return Err(Error::input(place, "no path", "socket:PATH"));
        }
        let stream = UnixStream::connect(Path::new(path)).map_err(|e| Error::io(place, e))?;
        Ok(Self::new(Stream::Unix(stream), address))
    }

    /// Connects to `HOST:PORT`; `place` names it in messages.
    pub(super) fn connect_tcp(
        host: &str,
        address: &str,
        timeout: Duration,
        place: &str,
    ) -> Result<Self> {
        let colon = host.rsplit_once(':').filter(|(name, _)| !name.is_empty());
        let Some(Ok(_)) = colon.map(|(_, port)| port.parse::<u16>()) else {
            return Err(Error::input(
                place,
                format!("{host:?}"),
                "tcp:HOST:PORT, the port a number from 0 to 65535",
            ));
        };
        let token = sockets::token()?;
        let stream = sockets::connect(host, timeout, place)?;
        let mut camera = Self::new(Stream::Tcp(stream), address);
        if let Some(token) = token {
            camera.present(&token, timeout)?;
        }
        Ok(camera)
    }

    fn new(stream: Stream, address: &str) -> Self {
        Self {
            stream,
            address: address.to_owned(),
            opening: Some(Vec::new()),
            received: HashSet::new(),
            decoder: FrameDecoder::default(),
            lost: false,
            skipped: false,
        }
    }

    /// Presents a token and waits until the device has accepted it.
    ///
    /// # Errors
    /// Returns an error if the device refuses it or does not answer within the timeout.
    fn present(&mut self, token: &Token, timeout: Duration) -> Result<()> {
        let end = Instant::now() + timeout;
        if let Stream::Tcp(stream) = &mut self.stream {
            // Ignore a failed write: a device that refuses the client sends the reason before it
            // closes the connection, and that reason is read below.
            let _ = stream
                .set_write_timeout(Some(timeout.max(Duration::from_micros(1))))
                .and_then(|()| stream.write_all(token.to_line().as_bytes()));
        }
        loop {
            match self.read_opening(end)? {
                Some(Opening::TokenRequired) => {}
                Some(Opening::Admitted | Opening::Frames) => return Ok(()),
                None => {
                    return Err(Error::device(format!(
                        "{}: no answer to the token within {} s; a device served without \
                         --tcp-token does not answer: unset {} for it",
                        self.address,
                        timeout.as_secs_f64(),
                        sockets::TOKEN_FILE
                    )));
                }
            }
        }
    }

    /// Reads the next line before the first frame, or detects the start of the first frame; `None`
    /// if neither has completely arrived by `end`.
    ///
    /// # Errors
    /// Returns an error if the device refuses the client, closes the connection or repeats a line.
    fn read_opening(&mut self, end: Instant) -> Result<Option<Opening>> {
        let mut expired = false;
        while let Some(bytes) = &mut self.opening {
            // Bound the whole wait, even if the peer keeps sending single bytes.
            if expired {
                return Ok(None);
            }
            // The first four bytes distinguish a line from a frame. The rest of a line is read one
            // byte at a time, so that no byte of a following frame is consumed.
            let mut next = [0; 4];
            let missing = 4_usize.saturating_sub(bytes.len()).max(1);
            let left = end.saturating_duration_since(Instant::now());
            expired = left.is_zero();
            let Some(len) = self
                .stream
                .read_some(&mut next[..missing], left, &self.address)?
            else {
                return Ok(None);
            };
            bytes.extend_from_slice(&next[..len]);
            if bytes.len() < 4 {
                continue;
            }
            let letters: [u8; 4] = bytes[..4].try_into().expect("four bytes");
            if ![TOKEN_REQUIRED, ADMITTED, REFUSED].contains(&letters) {
                self.decoder.space()[..4].copy_from_slice(bytes);
                self.opening = None;
                // A frame header is longer than four bytes, so these four bytes do not complete a
                // frame.
                self.decoder.advance(4)?;
                break;
            }
            if bytes.last() != Some(&b'\n') && bytes.len() < MAX_LINE {
                continue;
            }
            let line = std::mem::take(bytes);
            let repeated = !self.received.insert(letters);
            return match letters {
                TOKEN_REQUIRED | ADMITTED if repeated => Err(Error::device(format!(
                    "{}: a second {} line before the first frame; expected at most one",
                    self.address,
                    String::from_utf8_lossy(&letters)
                ))),
                TOKEN_REQUIRED => Ok(Some(Opening::TokenRequired)),
                ADMITTED => Ok(Some(Opening::Admitted)),
                _ => {
                    let reason = String::from_utf8_lossy(line[4..].trim_ascii()).into_owned();
                    let reason = printable(&reason);
                    Err(Error::device(format!(
                        "{}: refused: {reason}",
                        self.address
                    )))
                }
            };
        }
        Ok(Some(Opening::Frames))
    }
}

impl Camera for SocketCamera {
    fn info(&self) -> &str {
        &self.address
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        self.skipped = false;
        if self.lost {
            return Err(Error::device(format!(
                "{}: the frame stream is out of sync",
                self.address
            )));
        }
        let end = Instant::now() + timeout;
        while self.opening.is_some() {
            match self.read_opening(end)? {
                None => return Ok(None),
                Some(Opening::Admitted | Opening::Frames) => {}
                Some(Opening::TokenRequired) => {
                    return Err(Error::device(format!(
                        "{}: the device requires a token, found none; expected {} to name the file \
                         of its --tcp-token",
                        self.address,
                        sockets::TOKEN_FILE
                    )));
                }
            }
        }
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let space = self.decoder.space();
            let Some(len) = self.stream.read_some(space, left, &self.address)? else {
                return Ok(None);
            };
            match self.decoder.advance(len) {
                Ok(None) => {}
                Ok(frame) => return Ok(frame),
                Err(e) => {
                    self.skipped = self.decoder.in_step();
                    self.lost = !self.skipped;
                    return Err(Error::device(format!("{}: {e}", self.address)));
                }
            }
            // Bound the whole wait, even if the peer keeps sending single bytes.
            if left.is_zero() {
                return Ok(None);
            }
        }
    }

    fn has_skipped(&self) -> bool {
        self.skipped
    }

    fn identifies(&self) -> bool {
        !self.decoder.counted()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraDriver, open_camera};
    use phasmid_protocol::{PixelFormat, wire};
    use std::io::Write;
    use std::net::TcpListener;
    use std::os::unix::net::UnixListener;
    use std::sync::mpsc;
    use std::thread;

    fn refusal(address: &str) -> Error {
        match open_camera(address, CameraDriver::Auto, Duration::from_millis(200)) {
            Ok(_) => panic!("{address}"),
            Err(e) => e,
        }
    }

    #[test]
    fn invalid_addresses_are_usage_errors() {
        for address in [
            "",
            "socket:",
            "tcp:",
            "tcp:host",
            "tcp::1",
            "tcp:a:99999",
            "cam0",
        ] {
            let error = refusal(address);
            assert_eq!(error.exit_code(), 2, "{error}");
            let kind = address.split(':').next().unwrap_or_default();
            let allowed = if kind == "socket" {
                "socket:PATH"
            } else {
                "tcp:HOST:PORT"
            };
            assert!(error.to_string().contains(allowed), "{error}");
        }
        assert_eq!(refusal("socket:/no/such/socket").exit_code(), 2);
    }

    fn frame(id: u64) -> Frame {
        Frame {
            id,
            pattern_index: Some(3),
            width: 50,
            height: 40,
            format: PixelFormat::Grey,
            exposure_start_ns: 1,
            exposure_end_ns: 2,
            data: vec![id as u8; 2000],
        }
    }

    #[test]
    fn frames_come_in_pieces_and_a_damaged_header_is_final() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("camera.sock");
        let listener = UnixListener::bind(&path).unwrap();
        let address = format!("socket:{}", path.display());
        let mut camera = open_camera(&address, CameraDriver::Auto, Duration::from_secs(1)).unwrap();
        let (mut device, _) = listener.accept().unwrap();
        let short = Duration::from_millis(5);
        assert_eq!(camera.next_frame(short).unwrap(), None);
        let bytes = |id| [&wire::encode_header(&frame(id))[..], &frame(id).data].concat();
        for piece in [&bytes(1)[..30], &bytes(1)[30..500]] {
            device.write_all(piece).unwrap();
            assert_eq!(camera.next_frame(short).unwrap(), None);
        }
        device.write_all(&bytes(1)[500..]).unwrap();
        device.write_all(&bytes(2)).unwrap();
        assert_eq!(camera.next_frame(short).unwrap(), Some(frame(1)));
        assert_eq!(camera.next_frame(short).unwrap(), Some(frame(2)));
        let mut bad = bytes(3);
        bad[100] ^= 1;
        device.write_all(&bad).unwrap();
        let message = camera.next_frame(short).unwrap_err().to_string();
        assert!(
            message.contains("frame 3") && message.contains(&address),
            "{message}"
        );
        assert!(camera.has_skipped());
        device.write_all(&bytes(4)).unwrap();
        assert_eq!(camera.next_frame(short).unwrap(), Some(frame(4)));
        assert!(!camera.has_skipped());
        let mut bad = bytes(5);
        bad[30] ^= 1;
        device.write_all(&bad).unwrap();
        device.write_all(&bytes(6)).unwrap();
        for _ in 0..2 {
            assert!(camera.next_frame(short).is_err());
            assert!(!camera.has_skipped());
        }
    }

    #[test]
    fn frames_without_pattern_identity_are_recognised() {
        let (here, mut device) = std::os::unix::net::UnixStream::pair().unwrap();
        let mut camera = SocketCamera::new(Stream::Unix(here), "socket:test");
        for (header, identifies) in [
            (wire::encode_counted_header(&frame(1)), false),
            (wire::encode_header(&frame(1)), true),
        ] {
            device.write_all(&header).unwrap();
            device.write_all(&frame(1).data).unwrap();
            let next = camera.next_frame(Duration::from_secs(1)).unwrap();
            assert_eq!((next, camera.identifies()), (Some(frame(1)), identifies));
        }
    }

    #[test]
    fn repeated_opening_lines_do_not_extend_the_wait() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("token");
        std::fs::write(&file, "0123456789abcdef").unwrap();
        for line in ["PHTK", "PHOK"] {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let here = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let server = thread::spawn(move || {
                let (mut device, _) = listener.accept().unwrap();
                let lines = format!("{line}\n").repeat(1000);
                // Writing fails once the client has hung up.
                while device.write_all(lines.as_bytes()).is_ok() {}
            });
            let token = Token::read(&file).unwrap();
            let (sender, results) = mpsc::channel();
            let client = thread::spawn(move || {
                // Wait for the first lines, so that the call with a timeout of zero finds them.
                here.peek(&mut [0]).unwrap();
                let mut camera = SocketCamera::new(Stream::Tcp(here), "tcp:test");
                for timeout in [Duration::ZERO, Duration::from_secs(30)] {
                    let result = if line == "PHTK" {
                        camera.present(&token, timeout).map(|()| None)
                    } else {
                        camera.next_frame(timeout)
                    };
                    sender.send(result).unwrap();
                }
            });
            let next = || {
                let result = results.recv_timeout(Duration::from_secs(60));
                result.expect("the client returns within its timeout")
            };
            match next() {
                Ok(None) => assert_eq!(line, "PHOK"),
                Ok(frame) => panic!("{line}: {frame:?}"),
                Err(e) => assert!(e.to_string().contains("no answer to the token"), "{e}"),
            }
            let message = next().unwrap_err().to_string();
            let expected = format!("tcp:test: a second {line} line");
            assert!(message.starts_with(&expected), "{message}");
            client.join().unwrap();
            server.join().unwrap();
        }
    }

    #[test]
    fn a_camera_that_goes_is_noticed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("camera.sock");
        let listener = UnixListener::bind(&path).unwrap();
        let address = format!("socket:{}", path.display());
        let mut camera = open_camera(&address, CameraDriver::Auto, Duration::from_secs(1)).unwrap();
        drop(listener.accept().unwrap());
        let message = camera.next_frame(Duration::from_secs(1)).unwrap_err();
        assert!(message.to_string().contains("closed"), "{message}");
    }
}
