//! Recordings of cameras with more than 8 bits per pixel, packed or in words.

use crate::alone;
use crate::replays::{assert_same, replay, stop};
use crate::served::{LONG, Served, phasmid, text};
use phasmid::protocol::record::{Event, Reader};
use phasmid::protocol::wire::FrameDecoder;
use phasmid::protocol::{Frame, PixelFormat};
use rustix::process::Signal;
use std::fs;
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Command, Stdio};

/// Returns the command `phasmid serve` with a recording, for the built-in webcam with another
/// format, a sensor of more bits, and a data line.
fn serve(dir: &Path, format: PixelFormat, bits: u32, recording: &Path) -> Command {
    let mut text = include_str!("../../device-profiles/webcam-grey.toml").to_owned();
    let gain = 0.02091 * f64::from(1u32 << (bits - 8));
    for (old, new) in [
        (
            "format = \"GREY\"",
            format!("format = \"{}\"", format.name()),
        ),
        ("data_line = false", "data_line = true".to_owned()),
        ("gain_dn_per_e = 0.02091", format!("gain_dn_per_e = {gain}")),
        ("\nbits = 8\n", format!("\nbits = {bits}\n")),
    ] {
        assert!(text.contains(old), "{old}");
        text = text.replacen(old, &new, 1);
    }
    let profile = dir.join("profile.toml");
    fs::write(&profile, text).unwrap();
    let mut command = phasmid();
    command.args(["serve", "--scene", "plane", "--profile"]);
    command.arg(profile).arg("--record").arg(recording);
    command
}

/// Exposes a sequence and returns its frames as the frame socket sends them. Rows of 301 pixels end
/// with an incomplete group in every packed format.
fn expose_sequence(served: &Served) -> Vec<Frame> {
    let mut instrument = served.instrument();
    let settings = "TRIG:SOUR BUS;:CAM:ROI 41,100,301,24";
    instrument.order(settings).unwrap();
    let path = served.at.camera_socket.strip_prefix("socket:").unwrap();
    let mut camera = UnixStream::connect(path).unwrap();
    camera.set_read_timeout(Some(LONG)).unwrap();
    instrument.tell("INIT;*TRG").unwrap();
    let mut decoder = FrameDecoder::default();
    let mut frames = Vec::new();
    while frames.len() < 13 {
        let len = camera.read(decoder.space()).unwrap();
        assert!(len > 0, "the camera has closed the connection");
        frames.extend(decoder.advance(len).unwrap());
    }
    frames
}

/// Returns the frames of a recording.
fn recorded_frames(file: &Path) -> Vec<Frame> {
    let mut reader = Reader::new(fs::File::open(file).unwrap(), "recording").unwrap();
    let records = std::iter::from_fn(|| reader.read().unwrap());
    records
        .filter_map(|record| match record.event {
            Event::Frame(frame) => Some(Frame::clone(&frame)),
            _ => None,
        })
        .collect()
}

#[test]
fn frames_are_recorded_exported_and_replayed_as_sent() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let at = |name: &str| base.path().join(name);
    for (format, bits) in [
        (PixelFormat::Y12P, 12),
        (PixelFormat::Y10P, 10),
        (PixelFormat::Y10, 10),
    ] {
        let (file, exported) = (at(&format!("{format:?}.rec")), at(format.name()));
        let served = Served::spawn(&mut serve(base.path(), format, bits, &file));
        let sent = expose_sequence(&served);
        served.stop(Signal::TERM);
        for frame in &sent {
            assert_eq!((frame.format, frame.width, frame.height), (format, 301, 25));
        }
        assert!(recorded_frames(&file) == sent, "{format:?}");

        let mut command = replay(&file, &["--clock", "fast"]);
        let replayed = Served::spawn_as_it_is(command.stderr(Stdio::piped()));
        assert!(expose_sequence(&replayed) == sent, "{format:?}");
        assert_eq!(stop(replayed), (Some(0), String::new()), "{format:?}");

        let export = phasmid()
            .args(["record", "export"])
            .arg(&file)
            .arg("--out")
            .arg(&exported)
            .output()
            .unwrap();
        assert!(export.status.success(), "{}", text(&export));
        for (i, frame) in sent.into_iter().enumerate() {
            let png = image::open(exported.join(format!("frame_{i:06}.png"))).unwrap();
            let png = png.as_luma16().expect("16 bits per pixel");
            assert_eq!(png.dimensions(), (301, 25));
            let words = frame.into_luma().data;
            let words = words.chunks_exact(2);
            let wanted: Vec<_> = words.map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
            assert!(png.as_raw() == &wanted, "{format:?} {i}");
            // The first row is the data line.
            let brightest = *wanted[301..].iter().max().unwrap();
            assert!(brightest < 1 << bits, "{format:?} {i}: {brightest}");
            // The first four patterns are fringes.
            assert!(brightest > 255 || i >= 4, "{format:?} {i}: {brightest}");
        }
    }
}

/// The device records what it sends. The host records what it decodes: Y16 without the data line.
#[test]
fn a_scan_of_a_packed_camera_is_replayed_from_either_side() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let at = |name: &str| base.path().join(name);
    let (device, host) = (at("device.rec"), at("host.rec"));
    let served = Served::spawn(&mut serve(base.path(), PixelFormat::Y12P, 12, &device));
    let scan = served.scan(&at("scan"), &["--record", host.to_str().unwrap()]);
    assert!(scan.status.success(), "{}", text(&scan));
    served.stop(Signal::TERM);
    for (file, format, height) in [
        (&device, PixelFormat::Y12P, 481),
        (&host, PixelFormat::Y16, 480),
    ] {
        let frames = recorded_frames(file);
        assert_eq!(frames.len(), 13);
        for frame in frames {
            assert_eq!((frame.format, frame.height), (format, height));
        }
        let mut command = replay(file, &["--clock", "fast"]);
        let replayed = Served::spawn_as_it_is(command.stderr(Stdio::piped()));
        let out = at("again");
        let scan = replayed.scan(&out, &["--force"]);
        assert!(scan.status.success(), "{format:?} {}", text(&scan));
        assert_same(&at("scan"), &out);
        assert_eq!(stop(replayed), (Some(0), String::new()), "{format:?}");
    }
}
