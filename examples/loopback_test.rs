//! Tests a scanner driver without the scanner, as in continuous integration. The driver is any
//! program that opens a serial port and a camera; this one reads the device's identity and a frame
//! with nothing but the standard library.
//!
//! ```sh
//! cargo test --release --example loopback_test
//! ```

use std::fs::OpenOptions;
use std::io::{BufRead, BufReader, Read, Result, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

/// Asks the scanner at a serial port for its identity.
fn identity(port: &Path) -> Result<String> {
    let mut port = OpenOptions::new().read(true).write(true).open(port)?;
    port.write_all(b"*IDN?\n")?;
    let mut answer = String::new();
    BufReader::new(port).read_line(&mut answer)?;
    Ok(answer.trim_end().to_owned())
}

/// Receives a frame of the free-running camera behind a frame socket: width, height and bytes.
fn frame(socket: &Path) -> Result<(u32, u32, Vec<u8>)> {
    let mut camera = UnixStream::connect(socket)?;
    let mut header = [0; 72];
    camera.read_exact(&mut header)?;
    let number = |at: usize| u32::from_le_bytes(header[at..at + 4].try_into().expect("four bytes"));
    let (width, height) = (number(20), number(24));
    let mut bytes = vec![0; number(48) as usize];
    camera.read_exact(&mut bytes)?;
    Ok((width, height, bytes))
}

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(port), Some(socket)) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: loopback_test SERIAL_PORT FRAME_SOCKET");
        std::process::exit(2);
    };
    println!("{}", identity(Path::new(&port))?);
    let (width, height, _) = frame(Path::new(&socket))?;
    println!("frames of {width} x {height} pixels");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid::{Device, ServeOptions};

    #[test]
    fn driver_reads_identity_and_a_frame() {
        let device = Device::builder()
            .profile("webcam-grey")
            .scene("plane")
            .build()
            .unwrap();
        let serving = device.serve(&ServeOptions::default()).unwrap();
        let at = serving.endpoints();
        assert!(
            identity(&at.control)
                .unwrap()
                .starts_with("Phasmid,webcam-grey,")
        );
        let socket = at.camera_socket.strip_prefix("socket:").unwrap();
        let (width, height, bytes) = frame(Path::new(socket)).unwrap();
        assert_eq!((width, height), (640, 480));
        assert_eq!(bytes.len(), 640 * 480);
        serving.stop().unwrap();
    }
}
