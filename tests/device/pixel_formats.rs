//! Pixel formats of more than 8 bits: the formats that a profile accepts, the formats that the
//! control port offers, and the bytes that the camera sends for a region.

use phasmid::emulator::{Device, MemorySink, Readout, Roi};
use phasmid::profile::{Profile, Scene};
use phasmid::protocol::{Frame, PixelFormat, data_line};

use PixelFormat::{Grey, Y10, Y10P, Y12, Y12P, Y16, Yuyv};

/// Returns the text of a profile with another format and bit depth.
fn text(format: &str, bits: u32) -> String {
    let text = include_str!("../../device-profiles/webcam-grey.toml");
    let text = text.replacen("format = \"GREY\"", &format!("format = \"{format}\""), 1);
    text.replacen("\nbits = 8\n", &format!("\nbits = {bits}\n"), 1)
}

#[test]
fn profile_takes_only_formats_that_hold_the_sensors_bits() {
    for (format, allowed) in [
        (Grey, 8..=8),
        (Yuyv, 8..=8),
        (Y16, 9..=16),
        (Y10, 9..=10),
        (Y10P, 9..=10),
        (Y12, 11..=12),
        (Y12P, 11..=12),
    ] {
        for bits in 8..=16 {
            let profile = Profile::parse(&text(format.name(), bits), "test.toml");
            assert_eq!(
                profile.is_ok(),
                allowed.contains(&bits),
                "{format:?} {bits}"
            );
            match profile {
                Ok(profile) => assert!(profile.camera.sensor.formats().contains(&format)),
                Err(e) => assert!(e.to_string().contains("camera.sensor.bits"), "{e}"),
            }
        }
    }
}

#[test]
fn control_port_switches_between_the_formats_of_the_sensor() {
    let profile = Profile::parse(&text("Y12P", 12), "test.toml").unwrap();
    let mut bench = Device::builder(&profile, &Scene::load("plane").unwrap())
        .seed(1)
        .build()
        .unwrap()
        .bench(MemorySink::default());
    let mut ask = |line: &str| {
        let reply = bench.control(format!("{line}\n").as_bytes());
        String::from_utf8(reply).unwrap().trim_end().to_owned()
    };
    assert_eq!(ask("CAM:FORM?"), "Y12P");
    // The last group of pixels in a packed row may extend beyond the region.
    assert_eq!(ask("CAM:ROI 3,2,301,5;ROI?"), "3,2,301,5");
    for format in ["Y12", "Y16", "Y12P"] {
        assert_eq!(ask(&format!("CAM:FORM {format};FORM?")), format);
    }
    for format in ["GREY", "Y10", "Y10P"] {
        ask(&format!("CAM:FORM {format}"));
        assert!(ask("SYST:ERR?").starts_with("-224"), "{format}");
    }
    assert_eq!(ask("TRIG:SOUR BUS;:INIT;*TRG;*OPC?"), "1");
    let frame = bench.sink.frames.front().expect("a frame").clone();
    assert_eq!((frame.width, frame.height, frame.format), (301, 5, Y12P));
    assert_eq!(frame.data.len(), Y12P.frame_bytes(301, 5));
}

#[test]
fn regions_are_cropped_before_packing() {
    let (width, height) = (301u32, 4u32);
    let value = |x: u32, y: u32| ((x * 37 + y * 501) % 1024) as u16;
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| value(x, y)));
    let whole = Frame {
        id: 9,
        pattern_index: Some(2),
        width,
        height,
        format: Y16,
        exposure_start_ns: 10,
        exposure_end_ns: 30,
        data: pixels.flat_map(u16::to_le_bytes).collect(),
    };
    for format in [Y16, Y10, Y10P, Y12, Y12P] {
        for (x, columns) in [(0, 256), (1, 257), (2, 258), (3, 259), (45, 256)] {
            for line in [None, Some(1023)] {
                let readout = Readout {
                    roi: Roi {
                        x,
                        y: 1,
                        width: columns,
                        height: 2,
                    },
                    format,
                    data_line: line,
                };
                let sent = readout.read(whole.clone());
                assert_eq!(sent.format, format);
                assert!(readout.stream(1).carries(&sent), "{format:?} {columns}");
                let (found, lined) = data_line::strip(sent.into_luma());
                assert_eq!(lined == data_line::Found::Line, line.is_some());
                let wanted = (1..3).flat_map(|y| (x..x + columns).map(move |x| value(x, y)));
                let wanted: Vec<u8> = wanted.flat_map(u16::to_le_bytes).collect();
                assert!(found.data == wanted, "{format:?} at {x}, {columns} columns");
                assert_eq!((found.id, found.width, found.height), (9, columns, 2));
            }
        }
    }
}
