//! `phasmid camera info` for a USB device that is not attached through a kernel.

use crate::usb::served::Served;
use phasmid::link::usb::Event;
use phasmid::profile::{Profile, Speed, Transfer};
use serde_json::{Value, json};
use std::process::{Command, Output};

fn info(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(["camera", "info"])
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap()
}

#[test]
fn info_lists_device_and_starts_no_stream() {
    let served = Served::new(Speed::Super, Transfer::Bulk);
    let profile = Profile::load("webcam-grey").unwrap();
    let address = format!("usb:{}", served.host);
    let done = info(&[&address]);
    assert!(done.status.success(), "{done:?}");
    let said = text(done.stdout);
    let (vendor, product) = (profile.usb.vendor_id, profile.usb.product_id);
    for part in [
        &format!("camera       {address}/1-1\n")[..],
        &profile.identity.model,
        &profile.identity.manufacturer,
        &profile.identity.serial,
        &format!("{vendor:04x}:{product:04x}"),
        "UVC 1.10",
        "SuperSpeed",
        "offers       GREY\n  300 x 200, every ",
        "offers       YUYV\n  300 x 200, every ",
        "exposure (integer) = 120, 1 to 5000 in steps of 1, default ",
        "gain (integer) = 0, 0 to ",
    ] {
        assert!(said.contains(part), "{part:?} in {said}");
    }
    let last = served.wait(|event| {
        assert!(!matches!(event, Event::Started | Event::Committed(_)));
        *event == Event::Detached
    });
    assert_eq!(last, Event::Detached);
    drop(served.open());
}

#[test]
fn control_characters_of_a_device_are_escaped() {
    let mut profile = Profile::load("webcam-grey").unwrap();
    profile.identity.model = "A\u{1b}[2J\u{9b}1m".to_owned();
    let served = Served::of(&profile, 1);
    let address = format!("usb:{}/1-1", served.host);
    let said = text(info(&[&address]).stdout);
    assert!(said.contains("card         A\\u{1b}[2J"), "{said}");
    assert!(!said.contains(|c: char| c.is_control() && c != '\n'));
    served.wait(|event| *event == Event::Detached);
    let said = text(info(&[&address, "--json"]).stdout);
    assert!(!said.trim_end().contains(char::is_control), "{said:?}");
    let report: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(report["card"], profile.identity.model);
    assert_eq!(report["bus"], "1-1");
    assert_eq!(report["formats"][0]["format"], "GREY");
    let exposure = &report["controls"][0];
    assert_eq!(exposure["value"], json!(120));
    assert_eq!(exposure["unit"], "100 us");
}

#[test]
fn invalid_or_busy_device_is_reported() {
    let done = info(&["usb:127.0.0.1"]);
    assert_eq!(done.status.code(), Some(2));
    assert!(text(done.stderr).contains("usb:HOST:PORT/BUSID"));
    let served = Served::new(Speed::High, Transfer::Bulk);
    let taken = served.open();
    let done = info(&[&format!("usb:{}/1-1", served.host), "--timeout", "2"]);
    assert_eq!(done.status.code(), Some(1));
    assert!(text(done.stderr).contains("another host"));
    assert!(done.stdout.is_empty());
    drop(taken);
}
