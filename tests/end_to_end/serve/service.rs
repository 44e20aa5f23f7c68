//! The service channel: every request shown in its documentation, and access control.

use crate::serve::clock::{ask, refused, service};
use crate::served::{LONG, Served, serve};
use phasmid::pattern::Pattern;
use phasmid::protocol::service::{Item, MAX_LINE, Placement, Reply, Request, Step, Which, call};
use rustix::process::Signal;
use std::fs::{self, Permissions};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

const DOCUMENTED: &str = include_str!("../../../src/protocol/service/requests.md");

/// Starts a device with a stepped clock and exposes its sequence once.
fn exposed() -> (Served, UnixStream) {
    let served = Served::spawn_as_it_is(serve().args(["--clock", "stepped"]));
    let mut stream = service(&served);
    expose(&served, &mut stream);
    (served, stream)
}

fn expose(served: &Served, stream: &mut UnixStream) {
    let mut instrument = served.instrument();
    instrument.order("ABOR;:TRIG:SOUR BUS;:INIT;*TRG").unwrap();
    ask(stream, Request::Clock(Step::StepNs(300_000_000)));
}

#[test]
fn every_documented_request_is_answered() {
    let (served, mut stream) = exposed();
    let rows = DOCUMENTED
        .lines()
        .filter_map(|line| line.strip_prefix("| `"));
    let lines: Vec<&str> = rows.map(|row| row.split_once("` |").unwrap().0).collect();
    assert!(lines.len() > 12, "{lines:?}");
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    for line in &lines {
        let request = Request::parse(line.as_bytes()).unwrap();
        assert!(request.to_line().len() <= MAX_LINE);
        stream.write_all(format!("{line}\n").as_bytes()).unwrap();
        let mut answer = Vec::new();
        reader.read_until(b'\n', &mut answer).unwrap();
        let reply = Reply::parse(&answer).unwrap();
        assert_eq!(reply.error, None, "{line}");
        let told = [
            reply.clock.is_some(),
            reply.frame.is_some(),
            reply.scene.is_some(),
            reply.device.is_some(),
            reply.fault.is_some(),
            reply.faults.is_some(),
            reply.sequence.is_some(),
            reply.calibration.is_some(),
            reply.fields.is_some(),
            !reply.plan.is_empty(),
        ];
        let (what, maps) = match request {
            Request::Get(Item::Truth) | Request::TruthAt(_) => (None, true),
            Request::TruthOfFrame(_) => (Some(1), true),
            Request::Get(Item::Clock) | Request::Clock(_) => (Some(0), false),
            Request::Get(Item::Objects) | Request::ObjectsAt(_) => (Some(2), false),
            Request::Get(Item::Device) => (Some(3), false),
            Request::Fault(_) => (Some(4), false),
            Request::Get(Item::Faults) => (Some(5), false),
            Request::Get(Item::Sequence) => (Some(6), false),
            Request::Get(Item::Calibration) => (Some(7), false),
            Request::Get(Item::Fields) => (Some(8), false),
            Request::Get(Item::Plan) | Request::Term(_) => (Some(9), false),
            Request::Do(_) | Request::Place(_) | Request::Set(_) | Request::ClearFaults(_) => {
                (None, false)
            }
        };
        assert_eq!(told.iter().position(|&told| told), what, "{line}");
        assert_eq!(reply.bytes > 0, maps, "{line}");
        let mut payload = vec![0; reply.bytes as usize];
        reader.read_exact(&mut payload).unwrap();
    }
    served.stop(Signal::TERM);
}

#[test]
fn a_frame_s_truth_is_that_of_its_time() {
    let (served, mut stream) = exposed();
    let depth = |stream: &mut UnixStream, id| {
        let (reply, maps) = call(stream, &Request::TruthOfFrame(id)).unwrap();
        // Only geometry maps are returned, since levels would depend on settings that may have
        // changed since the exposure.
        let names: Vec<_> = maps.maps.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, phasmid::Truth::MAPS[..11]);
        (reply.frame.unwrap(), maps.maps[0].1[240 * 640 + 320])
    };
    let (before, rest) = depth(&mut stream, 2);
    assert_eq!((before.id, before.pattern_index), (2, Some(2)));
    assert_eq!(
        (before.start_ns, before.exposure_ns),
        (32_000_000, 12_000_000)
    );
    assert_eq!(before.scene.time_ns, 38_000_000);
    let shown = before.shown.clone().unwrap();
    assert_eq!(shown.index, Some(2));
    assert!(
        matches!(shown.pattern, Some(Pattern::Fringe { .. })),
        "{shown:?}"
    );
    // The maps of a frame do not change when the wall is moved later.
    let place = |z| {
        Request::Place(Placement {
            object: 0,
            position_mm: [0.0, 0.0, z],
            rotation_deg: [0.0; 3],
        })
    };
    ask(&mut stream, place(700.0));
    assert_eq!(depth(&mut stream, 2), (before, rest));
    let fault = r#"{"fault":{"what":"dark","when":{"nth":2}}}"#;
    let id = ask(&mut stream, Request::parse(fault.as_bytes()).unwrap()).fault;
    assert_eq!(id, Some(1));
    expose(&served, &mut stream);
    let (dark, now) = depth(&mut stream, 14);
    assert_eq!(
        (now, dark.scene.objects[0].place.position_mm[2]),
        (700.0, 700.0)
    );
    assert_eq!(dark.faults.len(), 1, "{dark:?}");
    assert_eq!((dark.faults[0].fault, dark.faults[0].frame), (1, Some(14)));
    assert!(depth(&mut stream, 13).0.faults.is_empty());
    let faults = ask(&mut stream, Request::Get(Item::Faults)).faults.unwrap();
    assert_eq!((faults.standing.len(), faults.struck_in_all), (1, 1));
    for (request, needle) in [
        (Request::TruthOfFrame(26), "expected 0 to 25"),
        (Request::ClearFaults(Which::One(7)), "expected 1"),
        (
            Request::parse(br#"{"fault":{"what":"late","by_ms":-3}}"#).unwrap(),
            "fault.by_ms",
        ),
    ] {
        let words = refused(&mut stream, request);
        assert!(words.contains(needle), "{words}");
    }
    served.stop(Signal::TERM);
}

const SOCKET: &str = "PHASMID_TEST_SERVICE_SOCKET";

/// The mode of the socket's file excludes other users; if the mode has been relaxed, the device
/// itself refuses them.
#[test]
fn service_socket_refuses_other_users() {
    let served = Served::start(&[]);
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(
        (mode(&served.at.service), mode(&served.dir)),
        (0o600, 0o700)
    );
    if !rustix::process::geteuid().is_root() {
        return served.stop(Signal::TERM);
    }
    let base = served.dir.parent().unwrap();
    for (path, mode) in [
        (base, 0o755),
        (&served.dir, 0o755),
        (&served.at.service, 0o666),
    ] {
        fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    }
    // Runs this test program as another user, if that user is able to run it.
    let program = base.join("another");
    fs::copy(std::env::current_exe().unwrap(), &program).unwrap();
    fs::set_permissions(&program, Permissions::from_mode(0o755)).unwrap();
    let output = Command::new(&program)
        .args(["--ignored", "--exact", "service::another_user_asks"])
        .env(SOCKET, &served.at.service)
        .current_dir("/")
        .uid(65_534)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", crate::served::text(&output));
    fs::remove_file(program).unwrap();
    // The owner of the socket is still served.
    ask(&mut service(&served), Request::Get(Item::Clock));
    served.stop(Signal::TERM);
}

#[test]
#[ignore = "the other user's part of the test before it"]
fn another_user_asks() {
    let Some(socket) = std::env::var_os(SOCKET) else {
        return;
    };
    let mut stream = UnixStream::connect(socket).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    let _ = stream.write_all(b"{\"get\":\"clock\"}\n");
    let mut answer = Vec::new();
    // After the answer, the connection is reset because of unread data.
    let _ = stream.read_to_end(&mut answer);
    let line = answer.split(|&byte| byte == b'\n').next().unwrap();
    let words = Reply::parse(line).unwrap().error.unwrap();
    assert!(
        words.contains("user 65534; expected its owner, user 0"),
        "{words}"
    );
}
