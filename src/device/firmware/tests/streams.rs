//! Pixel formats, the width that the data line needs, and a link that must know the frame format in
//! advance.

use super::{MS, Port};
use crate::{Stream, StreamSink};
use phasmid_core::error::{Error, Result};
use phasmid_profile::Profile;
use phasmid_protocol::PixelFormat;
use std::sync::{Arc, Mutex};

/// A link that records announced formats, and refuses to change the format while a client reads.
#[derive(Clone, Default)]
struct Node(Arc<Mutex<(Vec<Stream>, bool)>>);

impl Node {
    fn told(&self) -> Vec<(u32, u32, PixelFormat, u64)> {
        let told = std::mem::take(&mut self.0.lock().unwrap().0);
        told.iter()
            .map(|s| (s.width, s.height, s.format, s.interval_ns / MS))
            .collect()
    }

    fn read(&self, on: bool) {
        self.0.lock().unwrap().1 = on;
    }
}

impl StreamSink for Node {
    fn announce(&mut self, stream: &Stream) -> Result<()> {
        let mut node = self.0.lock().unwrap();
        if node.1 {
            return Err(Error::device("the node is being read"));
        }
        node.0.push(*stream);
        Ok(())
    }
}

fn bench() -> Profile {
    Profile::load("pmp-bench").unwrap()
}

fn attached(profile: &Profile) -> (Port, Node) {
    let mut port = Port::of(profile);
    let node = Node::default();
    port.firmware.attach(Box::new(node.clone()));
    (port, node)
}

#[test]
fn a_sensor_of_more_bits_has_no_format_of_8_bits() {
    let mut profile = bench();
    profile.camera.sensor.bits = 12;
    profile.camera.format = PixelFormat::Y16;
    let mut port = Port::of(&profile);
    port.tell("CAM:FORM Y16");
    assert_eq!(port.ask("CAM:FORM?"), "Y16");
    for word in ["GREY", "YUYV"] {
        assert_eq!(port.ask(&format!("CAM:FORM {word}")), "");
        assert_eq!(port.error(), -224);
    }
}

#[test]
fn the_data_line_needs_its_columns() {
    let mut port = Port::of(&bench());
    port.tell("CAM:ROI 800,3,256,10");
    assert_eq!(port.ask("CAM:ROI?"), "800,3,256,10");
    assert_eq!(
        port.firmware.stream().height,
        11,
        "the data line adds a row"
    );
    for roi in ["0,0,255,10", "900,0,MAX,10"] {
        assert_eq!(port.ask(&format!("CAM:ROI {roi}")), "");
        assert_eq!(port.error(), -222, "{roi}");
    }
    port.tell("CAM:ROI MAX,MAX,MIN,MIN");
    assert_eq!(port.ask("CAM:ROI?"), "882,488,256,1");
    // YUYV encodes pairs of columns, so MAX is rounded down to an even number.
    port.tell("CAM:ROI 0,0,300,10;:CAM:FORM YUYV;ROI 1,0,MAX,10");
    assert_eq!(port.ask("CAM:ROI?"), "1,0,1136,10");
}

#[test]
fn link_is_notified_only_when_frame_format_changes() {
    let (mut port, node) = attached(&bench());
    port.tell("CAM:GAIN 3;EXP 5ms");
    assert_eq!(node.told(), [], "the interval is longer than the exposure");
    port.tell("CAM:FORM YUYV;ROI 0,0,300,100;INT 40ms");
    let yuyv = PixelFormat::Yuyv;
    assert_eq!(
        node.told(),
        [
            (1138, 490, yuyv, 20),
            (300, 101, yuyv, 20),
            (300, 101, yuyv, 40)
        ]
    );
    port.tell("SEQ:PER 60ms;:CAM:EXP 50ms");
    assert_eq!(node.told(), [(300, 101, yuyv, 50)]);
    port.tell("*RST");
    assert_eq!(node.told(), [(1138, 490, PixelFormat::Grey, 20)]);
}

#[test]
fn setting_stays_when_the_link_cannot_change() {
    let (mut port, node) = attached(&bench());
    port.tell("CAM:FORM YUYV;GAIN 3");
    node.read(true);
    for order in ["CAM:FORM GREY", "CAM:ROI 0,0,300,10", "*RST"] {
        assert_eq!(port.ask(order), "");
        let error = port.ask("SYST:ERR?");
        assert!(
            error.starts_with("-221") && error.contains("being read"),
            "{error}"
        );
        assert_eq!(port.ask("CAM:FORM?;ROI?"), "YUYV;0,0,1138,489");
    }
    assert_eq!(port.ask("CAM:GAIN?"), "0", "*RST resets all other settings");
    node.read(false);
    port.tell("CAM:FORM GREY");
}

#[test]
fn a_change_waits_for_the_frames_before_it() {
    let (mut port, node) = attached(&bench());
    port.tell("TRIG:SOUR BUS;:INIT;*TRG");
    // The frames are exposed but have not left the device.
    port.firmware.advance(10_000 * MS);
    let under_way = port.firmware.in_flight();
    assert_eq!(under_way, 22);
    let now = 10_000 * MS;
    port.firmware
        .receive(b"*TST?;:CAM:ROI 0,0,300,10;ROI?\n*IDN?\n", now);
    for left in (0..under_way).rev() {
        assert_eq!(node.told(), []);
        assert_eq!(port.firmware.take_output(), b"");
        port.firmware.delivered(1);
        assert_eq!(port.firmware.in_flight(), left);
    }
    let output = String::from_utf8(port.firmware.take_output()).unwrap();
    assert!(output.starts_with("0;0,0,300,10\nPhasmid,"), "{output}");
    assert_eq!(node.told().len(), 1);
}
