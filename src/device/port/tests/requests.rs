//! Requests that end a wait of the device, and requests that are refused.

use super::*;
use crate::State;

/// Returns the requests that a host sends for an operation.
fn operation(dialect: &Dialect, name: &str) -> Vec<Vec<u8>> {
    let operation = dialect.host().get(name).unwrap();
    let request = |(at, step): (usize, &phasmid_protocol::dialect::Step)| {
        let args = step.args(&[]).unwrap();
        let request = dialect.request(&step.command, &args, 40 + at as u8);
        request.unwrap()
    };
    operation.steps.iter().enumerate().map(request).collect()
}

/// A stop command acts when no other request waits, and also when as many requests wait as the
/// device can queue.
#[test]
fn a_stop_acts_while_the_device_waits() {
    for name in Dialect::names() {
        let dialect = Dialect::load(name).unwrap();
        for more in [0, 62, 200] {
            let mut desk = Desk::of(dialect.clone(), None);
            desk.talk(b"");
            for request in operation(&dialect, "quiet") {
                desk.talk(&request);
            }
            for request in operation(&dialect, "arm") {
                desk.talk(&request);
            }
            let state = |desk: &Desk| desk.machine.firmware().state();
            assert!(matches!(state(&desk), State::Armed { .. }), "{name}");
            let wait = operation(&dialect, "complete").concat();
            assert_eq!(desk.talk(&wait), b"", "{name} waits");
            let asks = operation(&dialect, "last_id").concat();
            desk.talk(&asks.repeat(more));
            // For SCPI, the stop command is only the first of the messages that the host sends to
            // stop the device.
            let stop = match dialect.is_scpi() {
                true => b"INIT:CONT OFF;:ABOR\n".to_vec(),
                false => operation(&dialect, "quiet").remove(0),
            };
            let said = desk.talk(&stop);
            assert_eq!(state(&desk), State::Idle, "{name} {more}");
            let (mut cutter, mut messages) = (dialect.cutter(Direction::ToHost), Vec::new());
            cutter.push(&said, &mut |cut| messages.push(cut));
            // The answer to the stop command comes first, if it has one; the answers of the waiting
            // requests follow.
            let own = usize::from(!dialect.is_scpi());
            let waited = 1 + more.min(if dialect.is_scpi() { 64 } else { 63 });
            assert_eq!(messages.len(), own + waited, "{name} {more}");
            assert!(desk.exposed.is_empty(), "{name}");
            assert!(!desk.talk(&asks).is_empty(), "{name} answers again");
        }
    }
}

/// Returns exposure and period in microseconds.
fn timing(desk: &mut Desk, dialect: &Dialect) -> [f64; 2] {
    let Reply::Done(values) = ask(desk, dialect, "timing?", &[]) else {
        panic!("timing? is answered");
    };
    [0, 1].map(|at: usize| (values[at].1.number().unwrap() * 1e6).round())
}

#[test]
fn refused_timing_leaves_settings_unchanged() {
    let dialect = Dialect::load("dlpc350").unwrap();
    let mut desk = Desk::new("dlpc350", None);
    let before = timing(&mut desk, &dialect);
    let mut set = |exposure: f64, period: f64| {
        let args = [
            ("exposure", (exposure / 1e6).into()),
            ("period", (period / 1e6).into()),
        ];
        let reply = ask(&mut desk, &dialect, "timing", &args);
        (reply, timing(&mut desk, &dialect))
    };
    for (exposure, period) in [
        (20_000.0, 16_000.0),
        (8000.0, 0.0),
        (0.0, 16_000.0),
        (900.0, 90.0),
    ] {
        let (reply, after) = set(exposure, period);
        assert!(
            matches!(reply, Reply::Refused { .. }),
            "{exposure} {period}: {reply:?}"
        );
        assert_eq!(after, before, "{exposure} {period}");
    }
    // Both values increase, then both decrease. The order in which the request sets them must not
    // cause an error.
    for (exposure, period) in [(40_000.0, 50_000.0), (6000.0, 9000.0)] {
        let (reply, after) = set(exposure, period);
        assert!(matches!(reply, Reply::Done(_)), "{reply:?}");
        assert_eq!(after, [exposure, period]);
    }
}

/// Returns the shipped dialect `okline` with additional commands. Each of them runs several
/// settings, and the last setting may be refused.
fn with_long_commands() -> Dialect {
    let text = Dialect::text("okline").unwrap();
    let more = r#"
[[command]]
name = "all"
line = "all {gain}"
runs = ["TRIG:SOUR BUS;MODE STEP", "SEQ:SEL \"quick-4-xy\"", "CAM:EXP MIN", "PROJ:POW OFF", "INIT;*TRG", "CAM:GAIN {gain}"]
args = [{ name = "gain", type = "float" }]

[[command]]
name = "late"
line = "late {gain}"
runs = ["PROJ:CURR 0.5", "*OPC?", "CAM:EXP MIN", "CAM:GAIN {gain}"]
args = [{ name = "gain", type = "float" }]

[[command]]
name = "both"
line = "both"
runs = ["CAM:GAIN 3;GAIN 99"]
[host]"#;
    Dialect::parse(&text.replacen("[host]", more, 1), "long").unwrap()
}

/// Returns the answers to queries of all settings that these tests change.
fn settings(desk: &mut Desk) -> String {
    let asks = [
        "source?",
        "select?",
        "exposure?",
        "gain?",
        "lamp?",
        "period?",
        "frames?",
    ];
    asks.iter().map(|ask| desk.line(ask)).collect()
}

#[test]
fn a_request_is_done_whole_or_not_at_all() {
    let mut desk = Desk::of(with_long_commands(), None);
    desk.talk(b"");
    desk.line("exposure 5000");
    let before = settings(&mut desk);
    // A refused request also undoes its own trigger, which has exposed nothing yet.
    assert!(desk.line("all 3").starts_with("error 21 "));
    assert_eq!(settings(&mut desk), before);
    assert_eq!(desk.machine.firmware().state(), State::Idle);
    assert!(desk.line("both").starts_with("error 20 "));
    assert_eq!(settings(&mut desk), before);
    assert!(desk.exposed.is_empty());
    // A request that is refused while the device exposes a sequence changes nothing either.
    for line in ["source soft", "arm"] {
        desk.line(line);
    }
    desk.machine.receive(b"fire\n", desk.now_ns);
    desk.machine.receive(b"all 3\n", desk.now_ns);
    let said = desk.line("wait");
    assert!(
        said.contains("error 21 ") && said.ends_with("!done\r\nok\r\n"),
        "{said}"
    );
    assert!(desk.exposed.iter().copied().eq((0..13).map(Some)));
}

#[test]
fn settings_before_a_wait_stay_after_a_later_failure() {
    let mut desk = Desk::of(with_long_commands(), None);
    desk.talk(b"");
    for line in ["exposure 5000", "source soft", "arm"] {
        desk.line(line);
    }
    assert_eq!(desk.line("late 99"), "", "armed");
    let said = desk.line("fire");
    assert!(
        said.ends_with("!done\r\nerror 20 out of range\r\n"),
        "{said}"
    );
    assert_eq!(desk.line("current?"), "ok 50\r\n");
    assert_eq!(desk.line("exposure?"), "ok 5000\r\n");
}
