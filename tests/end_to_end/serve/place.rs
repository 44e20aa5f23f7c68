//! Moving objects of the scene over the service socket.

use crate::served::{LONG, Served};
use phasmid::protocol::service::{self, Item, Maps, Placement, Request};
use std::fs;
use std::os::unix::net::UnixStream;
use std::path::Path;

fn ask(stream: &mut UnixStream, request: Request) -> phasmid::Result<Maps> {
    stream.set_read_timeout(Some(LONG)).unwrap();
    service::ask(stream, request)
}

fn place(object: u32, z: f64, tilt: f64) -> Request {
    Request::Place(Placement {
        object,
        position_mm: [10.0, 0.0, z],
        rotation_deg: [0.0, tilt, 0.0],
    })
}

/// Returns the files of a scan's frames.
fn frames(folder: &Path) -> Vec<Vec<u8>> {
    let name = |i| folder.join(format!("frame_{i:02}.png"));
    (0..13).map(|i| fs::read(name(i)).unwrap()).collect()
}

#[test]
fn plane_moves_to_the_requested_place() {
    let base = tempfile::tempdir().unwrap();
    let served = Served::start(&["--seed", "7"]);
    let mut stream = UnixStream::connect(&served.at.service).unwrap();
    let depth = |stream: &mut UnixStream| {
        let maps = ask(stream, Request::Get(Item::Truth)).unwrap();
        maps.maps[0].1[240 * 640 + 320]
    };
    let rest = depth(&mut stream);
    let done = ask(&mut stream, place(0, f64::from(rest) - 100.0, 0.0)).unwrap();
    assert!(done.maps.is_empty() && done.flags.is_empty());
    assert_eq!(depth(&mut stream), rest - 100.0);
    // An invalid request gets an error message; the connection stays open, and the plane does not
    // move.
    for (request, needle) in [
        (place(1, 900.0, 0.0), "place.object: 1"),
        (place(0, 2e9, 0.0), "place.position_mm"),
        (place(0, 900.0, 400.0), "place.rotation_deg"),
    ] {
        let refused = ask(&mut stream, request).unwrap_err().to_string();
        assert!(refused.contains(needle), "{refused}");
    }
    assert_eq!(depth(&mut stream), rest - 100.0);
    ask(&mut stream, place(0, 1100.0, 25.0)).unwrap();
    let moved = base.path().join("moved");
    assert!(served.scan(&moved, &["--no-decode"]).status.success());
    served.stop(rustix::process::Signal::TERM);

    // A device that starts with the moved plane in its scene gives the same bytes.
    let scene = include_str!("../../../device-profiles/scenes/plane.toml");
    let mut table: toml::Table = scene.parse().unwrap();
    let object = table["object"].as_array_mut().unwrap()[0].as_table_mut();
    let object = object.unwrap();
    for (field, values) in [
        ("position_mm", [10.0, 0.0, 1100.0]),
        ("rotation_deg", [0.0, 25.0, 0.0]),
    ] {
        let values = values.map(toml::Value::Float).to_vec();
        object.insert(field.into(), toml::Value::Array(values));
    }
    let file = base.path().join("scene.toml");
    fs::write(&file, table.to_string()).unwrap();
    let profile = [
        "serve",
        "--profile",
        "webcam-grey",
        "--seed",
        "7",
        "--scene",
    ];
    let mut command = crate::served::phasmid();
    let started = Served::spawn(command.args(profile).arg(&file));
    let still = base.path().join("still");
    assert!(started.scan(&still, &["--no-decode"]).status.success());
    assert!(frames(&moved) == frames(&still), "the same frames");
    started.stop(rustix::process::Signal::TERM);
}
