//! Sequences, including user-defined ones, and calibration over the port.

use super::{MS, Port};
use crate::PatternImage;
use phasmid_profile::Profile;

#[test]
fn calibration_and_manifest_come_as_blocks_that_read_back() {
    let mut port = Port::new();
    let profile = Profile::load("webcam-grey").unwrap();
    let block = |reply: String| {
        let (content, rest) = phasmid_protocol::scpi::split_block(reply.as_bytes()).unwrap();
        assert_eq!(rest, b"\n");
        String::from_utf8(content.to_vec()).unwrap()
    };
    let manifest =
        phasmid_pattern::Manifest::parse(&block(port.bytes(b"SEQ:DATA?\n")), "").unwrap();
    assert_eq!(manifest, profile.manifest(&profile.sequence[0]));
    let rig = |text: String| phasmid_geometry::Rig::from_toml(&text, "").unwrap();
    let factory = profile.factory_rig().unwrap();
    assert_eq!(rig(block(port.bytes(b"CAL:DATA?\n"))), factory);
    assert_ne!(factory.camera, profile.nominal_rig().camera);
    port.tell("CAM:ROI 100,50,200,100;GAIN 6");
    let cropped = rig(block(port.bytes(b"CAL:DATA?\n")));
    assert_eq!(cropped.covariance, factory.covariance);
    let (a, b) = (cropped.camera.lens, factory.camera.lens);
    assert_eq!((a.width_px, a.height_px), (200, 100));
    assert_eq!(
        b.principal_px - a.principal_px,
        glam::DVec2::new(100.0, 50.0)
    );
    assert_eq!(
        cropped.noise,
        Some(profile.camera.sensor.noise_model(6.0, 8e-3))
    );
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let image = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x + y) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn with_block(order: &str, content: &[u8]) -> Vec<u8> {
    let mut line = order.as_bytes().to_vec();
    line.extend(phasmid_protocol::scpi::encode_block(content));
    line.push(b'\n');
    line
}

#[test]
fn a_sequence_of_the_user_s_own_comes_over_the_port() {
    const HEAD: &str = "[projector]\nwidth_px = 854\nheight_px = 480\n";
    let mut port = Port::new();
    let own = format!(
        "{HEAD}[[frame]]\npattern = {{ kind = \"image\", file = \"dots.png\" }}\n\
         [[frame]]\npattern = {{ kind = \"white\" }}\n"
    );
    let define = |toml: &str| with_block("SEQ:DEF 'own',", toml.as_bytes());
    for (bytes, code) in [
        (define(&own), -256),
        (with_block("SEQ:IMAG 'dots.png',", b"no picture"), -224),
        (with_block("SEQ:IMAG 'dots.png',", &png(853, 480)), -224),
        (with_block("SEQ:IMAG 'dots.png',", &png(854, 480)), 0),
        (define("[projector"), -200),
        (define(&own.replace("854", "855")), -200),
        (with_block("SEQ:DEF 'quick-4',", own.as_bytes()), -224),
        (with_block("SEQ:DEF 'no/name',", own.as_bytes()), -224),
        (define(&own), 0),
        (b"SEQ:SEL 'own'\n".to_vec(), 0),
        (define(&own), 0),
        (b"SEQ:DEL 'own'\n".to_vec(), -221),
    ] {
        assert_eq!(port.bytes(&bytes), "");
        assert_eq!(
            port.error(),
            code,
            "{}",
            bytes[..40.min(bytes.len())].escape_ascii()
        );
    }
    assert_eq!(
        port.ask("SEQ:LIST?;COUN?;SEL?"),
        "\"quick-4\",\"quick-4-xy\",\"own\";2;\"own\""
    );
    port.tell("TRIG:SOUR BUS;:INIT;*TRG");
    port.at(1000 * MS);
    let Some(PatternImage::Image { levels, .. }) = port.shots[0].shot.pattern_image.as_deref()
    else {
        panic!("{:?}", port.shots)
    };
    assert_eq!(levels[854 + 3], 4, "row 1, column 3");
    port.tell("SEQ:SEL 'quick-4';DEL 'own';IMAG:DEL 'dots.png'");
    assert_eq!(port.ask("SEQ:LIST?"), "\"quick-4\",\"quick-4-xy\"");
}

#[test]
fn a_bad_manifest_says_why() {
    let mut port = Port::new();
    port.bytes(&with_block(
        "SEQ:DEF 'own',",
        b"[projector]\nwidth_px = -3\nheight_px = 1\n",
    ));
    let text = port.ask("SYST:ERR?");
    assert!(
        text.starts_with("-200,\"Execution error;own:1: missing field `frame`"),
        "{text}"
    );
    assert!(
        text.contains("own:2: projector.width_px: invalid value: integer `-3`"),
        "{text}"
    );
}
