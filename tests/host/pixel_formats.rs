//! Scans in every pixel format of a sensor of 10 or 12 bits, through the frames of the frame
//! socket: all give the frames and the decoded map of Y16.

use phasmid::decode::Capture;
use phasmid::decode::Options;
use phasmid::emulator::{Device, FrameSink};
use phasmid::host::{Intake, MemoryCamera, MemoryPort, ScanOptions, Scanner};
use phasmid::profile::{Profile, Scene};
use phasmid::protocol::wire::{self, FrameDecoder};
use phasmid::protocol::{Frame, PixelFormat};
use std::sync::Arc;
use std::time::Duration;

/// A camera that passes frames through the bytes of the frame socket.
struct Wire {
    camera: MemoryCamera,
    format: PixelFormat,
    /// Whether to remove the identity that frames carry beside the pixels, so that only the data
    /// line identifies them.
    anonymous: bool,
}

impl FrameSink for Wire {
    fn attended(&self) -> bool {
        true
    }

    fn put(&mut self, frame: Arc<Frame>) {
        assert_eq!(frame.format, self.format);
        let mut frame = (*frame).clone();
        if self.anonymous {
            (frame.id, frame.pattern_index) = (0, None);
        }
        let bytes = [&wire::encode_header(&frame)[..], &frame.data].concat();
        let (mut decoder, mut rest) = (FrameDecoder::default(), &bytes[..]);
        while !rest.is_empty() {
            let space = decoder.space();
            let len = space.len().min(rest.len());
            space[..len].copy_from_slice(&rest[..len]);
            rest = &rest[len..];
            if let Some(received) = decoder.advance(len).unwrap() {
                assert_eq!(received, frame);
                self.camera.put(received);
            }
        }
    }
}

/// Returns a profile of the centre of the built-in webcam's image, with a sensor of more bits. The
/// width is not a multiple of the group size of a packed format.
fn profile(bits: u32, format: PixelFormat, data_line: bool) -> Profile {
    let mut profile = Profile::load("webcam-grey").unwrap();
    let camera = &mut profile.camera;
    camera.sensor_width_mm *= 319.0 / f64::from(camera.width_px);
    (camera.width_px, camera.height_px) = (319, 60);
    (camera.format, camera.data_line) = (format, data_line);
    let factor = f64::from(1u32 << (bits - camera.sensor.bits));
    camera.sensor.bits = bits;
    camera.sensor.gain_dn_per_e *= factor;
    camera.sensor.black_level_dn *= factor;
    profile
}

fn scan(profile: &Profile, anonymous: bool) -> Capture {
    let timeout = Duration::from_millis(20);
    let camera = MemoryCamera::default();
    let sink = Wire {
        camera: camera.clone(),
        format: profile.camera.format,
        anonymous,
    };
    let mut bench = Device::builder(profile, &Scene::load("plane").unwrap())
        .seed(1)
        .build()
        .unwrap()
        .bench(sink);
    let port = MemoryPort::new(move |bytes: &[u8]| bench.control(bytes));
    let open = || Ok(Intake::new(camera));
    let mut scanner = Scanner::new(port, timeout, open).unwrap();
    let options = ScanOptions {
        sequence: None,
        manifest: None,
        frame_timeout: timeout,
    };
    scanner.scan(&options, &mut |_| {}).unwrap()
}

#[test]
fn every_format_decodes_like_y16() {
    use PixelFormat::{Y10, Y10P, Y12, Y12P, Y16};
    for (bits, formats) in [(10, [Y10, Y10P]), (12, [Y12, Y12P])] {
        for data_line in [false, true] {
            let wanted = scan(&profile(bits, Y16, data_line), false);
            let full = f64::from((1u32 << bits) - 1);
            let noise = wanted.calibration.unwrap().noise.unwrap();
            assert!(noise.saturation_dn > 0.9 * full && noise.saturation_dn <= full);
            let levels = wanted
                .images
                .iter()
                .flat_map(|image| image.as_u16().unwrap());
            let brightest = levels.max();
            assert!(brightest > Some(&0xFF), "more than 8 bits: {brightest:?}");
            let (_, map) = wanted.decode(Options::default()).unwrap();
            let x = map.x.unwrap().coordinate;
            let decoded = x.iter().filter(|x| x.is_finite()).count();
            assert!(decoded > x.len() / 2, "{decoded} of {}", x.len());
            for format in formats {
                let captured = scan(&profile(bits, format, data_line), data_line);
                let shown = |captured: &Capture| -> Vec<_> {
                    captured.frames.iter().map(|f| f.pattern_index).collect()
                };
                assert_eq!(shown(&captured), shown(&wanted), "{format:?} {data_line}");
                assert!(captured.images == wanted.images, "{format:?} {data_line}");
                assert_eq!(captured.calibration.unwrap().noise, Some(noise));
                let (_, map) = captured.decode(Options::default()).unwrap();
                let same = |a: &f32, b: &f32| a.to_bits() == b.to_bits();
                let found = map.x.unwrap().coordinate;
                assert!(found.iter().zip(&x).all(|(a, b)| same(a, b)), "{format:?}");
            }
        }
    }
}
