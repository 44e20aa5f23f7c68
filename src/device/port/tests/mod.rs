//! The shipped dialects on a device without optics, as a client at the other end of the line sees
//! them: the bytes of the replies and their times, to the nanosecond.

mod requests;

use super::Port;
use crate::faults::Faults;
use crate::{Firmware, Machine, SerialLine};
use phasmid_profile::{Control, Profile};
use phasmid_protocol::dialect::{Cut, Dialect, Direction, Reply, Value};
use std::sync::Arc;

/// A device whose frames leave it immediately after their exposure.
struct Desk {
    machine: Machine,
    now_ns: u64,
    /// Arrival time in nanoseconds and value of each byte received from the device.
    came: Vec<(u64, u8)>,
    /// Pattern index of each exposure.
    exposed: Vec<Option<u32>>,
}

impl Desk {
    fn new(dialect: &str, baud: Option<u32>) -> Self {
        Self::of(Dialect::load(dialect).unwrap(), baud)
    }

    fn of(dialect: Dialect, baud: Option<u32>) -> Self {
        let mut profile = Profile::load("webcam-grey").unwrap();
        profile.control = Control {
            baud,
            ..Control::default()
        };
        let firmware = Firmware::new(&profile, &[]).unwrap();
        let port = Port::new(Arc::new(dialect)).unwrap();
        let line = SerialLine::new(&profile.control);
        Self {
            machine: Machine::new(firmware, port, line, Faults::default()),
            now_ns: 0,
            came: Vec::new(),
            exposed: Vec::new(),
        }
    }

    /// Sends bytes, advances time until no event is pending, and returns the bytes received.
    fn talk(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.machine.receive(bytes, self.now_ns);
        let from = self.came.len();
        self.look();
        while let Some(next) = self.machine.next_event_ns(false) {
            self.now_ns = next;
            self.machine.advance(next);
            self.look();
        }
        self.came[from..].iter().map(|(_, byte)| *byte).collect()
    }

    fn look(&mut self) {
        let exposures = self.machine.take_exposures(self.now_ns);
        for exposure in exposures {
            self.exposed.push(exposure.shot.pattern_index);
            self.machine.rendered(None, self.now_ns);
        }
        self.machine.frames_left();
        let bytes = self.machine.take_output(self.now_ns);
        self.came
            .extend(bytes.into_iter().map(|b| (self.now_ns, b)));
    }

    fn line(&mut self, line: &str) -> String {
        String::from_utf8(self.talk(format!("{line}\n").as_bytes())).unwrap()
    }
}

/// Returns the transmission time of `bytes` bytes with 8 data bits, no parity and 1 stop bit.
fn ns(bytes: u64, baud: u64) -> u64 {
    (bytes * 10_000_000_000).div_ceil(baud)
}

const BANNER: &str = "okline 1.0\r\nready\r\n";

#[test]
fn a_sequence_runs_over_plain_lines() {
    let mut desk = Desk::new("okline", None);
    assert_eq!(desk.line(""), BANNER, "boot chatter");
    assert_eq!(
        desk.now_ns, 150_000_000,
        "the last power-on message comes after 150 ms"
    );
    assert!(
        desk.line("version")
            .starts_with("scanner Phasmid,webcam-grey,")
    );
    for line in [
        "stop",
        "source soft",
        "MODE all ; a comment",
        "lamp on",
        "mark 7",
        "arm",
    ] {
        assert_eq!(desk.line(line), "ok\r\n", "{line}");
    }
    assert_eq!(desk.line("mark?"), "ok 7\r\n");
    assert_eq!(desk.line("wait"), "", "nothing has been triggered");
    // A trigger acts although the device waits. Its events follow, and after them the answer to the
    // earlier `wait`.
    let mut expected = "ok\r\n".to_owned();
    for index in 0..13 {
        expected += &format!("!frame {index} {index}\r\n");
    }
    expected += "!done\r\nok\r\n";
    assert_eq!(desk.line("fire"), expected);
    assert!(desk.exposed.iter().copied().eq((0..13).map(Some)));
    assert_eq!(desk.line("frames?"), "ok 13\r\n");
    desk.line("source wire");
    let now = desk.now_ns;
    desk.machine.firmware_mut().external_trigger(now);
    assert_eq!(desk.line("arm"), "!missed\r\nok\r\n");
}

#[test]
fn errors_have_the_dialect_s_numbers_and_are_not_left_behind() {
    let mut desk = Desk::new("okline", None);
    desk.talk(b"");
    for (line, number) in [
        ("gain 99", 20),
        ("select nothing", 23),
        ("arm", 21),
        ("fire", 22),
        ("nonsense", 11),
    ] {
        let reply = desk.line(line);
        assert!(
            reply.starts_with(&format!("error {number} ")),
            "{line}: {reply}"
        );
    }
    let long = format!("select {}", "x".repeat(5000));
    assert!(desk.line(&long).starts_with("error 13 "));
    assert_eq!(
        desk.line("gain?"),
        "ok 0\r\n",
        "the next line is parsed normally"
    );
    let now = desk.now_ns;
    let firmware = desk.machine.firmware_mut();
    firmware.receive(b"SYST:ERR:COUN?\n", now);
    assert_eq!(firmware.take_output(), b"0\n");
}

#[test]
fn replies_do_not_depend_on_how_input_is_split() {
    let script = b"version\ngain 3\ngain?\nnonsense\nstop\nsource soft\narm\nfire\nwait\nframes?\n";
    let whole = Desk::new("okline", None).talk(script);
    let mut desk = Desk::new("okline", None);
    let mut told = Vec::new();
    for byte in script {
        told.extend(desk.talk(&[*byte]));
    }
    // If all commands come in one burst, the power-on banner comes between the replies, because
    // commands take no time to execute.
    let without = |bytes: Vec<u8>| {
        let text = String::from_utf8(bytes).unwrap();
        let lines = text.lines().filter(|l| !BANNER.contains(l));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(without(told), without(whole));
    assert_eq!(desk.exposed.len(), 13);
}

/// Sends a command as a packet and returns its reply.
fn ask(desk: &mut Desk, dialect: &Dialect, command: &str, args: &[(&str, Value)]) -> Reply {
    let sequence = (desk.came.len() % 251) as u8;
    let packet = dialect.request(command, args, sequence).unwrap();
    let bytes = desk.talk(&packet);
    let (mut cutter, mut replies) = (dialect.cutter(Direction::ToHost), Vec::new());
    cutter.push(&bytes, &mut |cut| match cut {
        Cut::Message(message) => replies.push(dialect.reply(command, &message, sequence)),
        Cut::Dropped(error) => panic!("{error}"),
    });
    assert_eq!(replies.len(), 1, "{command}");
    replies.remove(0)
}

#[test]
fn a_sequence_runs_over_packets() {
    let dialect = Dialect::load("dlpc350").unwrap();
    let mut desk = Desk::new("dlpc350", None);
    let text = |text: &str| Value::Text(text.to_owned());
    for (command, args) in [
        ("sequence", vec![("action", text("INIT:CONT OFF;:ABOR"))]),
        ("display", vec![("mode", text("BUS"))]),
        ("steps", vec![("mode", text("SEQ"))]),
        ("arm", vec![]),
        ("trigger", vec![]),
    ] {
        let reply = ask(&mut desk, &dialect, command, &args);
        assert!(matches!(reply, Reply::Done(_)), "{command}: {reply:?}");
    }
    assert!(desk.exposed.iter().copied().eq((0..13).map(Some)));
    let done = ask(&mut desk, &dialect, "complete?", &[]);
    assert!(matches!(done, Reply::Done(_)), "{done:?}");
    let Reply::Done(values) = ask(&mut desk, &dialect, "frames?", &[]) else {
        panic!()
    };
    assert_eq!(values[0].1.number(), Some(13.0));
    let refused = ask(&mut desk, &dialect, "trigger", &[]);
    assert!(
        matches!(refused, Reply::Refused { number: 5, .. }),
        "{refused:?}"
    );
}

#[test]
fn half_a_packet_is_given_up_and_the_next_one_is_read() {
    let dialect = Dialect::load("dlpc350").unwrap();
    let mut desk = Desk::new("dlpc350", None);
    let packet = dialect.request("frames?", &[], 9).unwrap();
    assert_eq!(desk.talk(&packet[..30]), b"");
    assert!(desk.machine.inside_block());
    desk.machine.input_stalled();
    assert!(!desk.machine.inside_block());
    let reply = desk.talk(&packet);
    assert_eq!((reply.len(), reply[1]), (64, 9));
    // The client disconnects in the middle of a packet.
    assert_eq!(desk.talk(&packet[..63]), b"");
    desk.machine.hang_up();
    assert_eq!(desk.talk(&packet), reply);
}

#[test]
fn replies_arrive_at_the_times_of_the_baud_rate() {
    for baud in [9600, 115_200] {
        let mut desk = Desk::new("scpi", Some(baud));
        let baud = u64::from(baud);
        assert_eq!(desk.talk(b"*TST?\n*TST?\n"), b"0\n0\n");
        // The first query has arrived after six bytes, the second after twelve. Each answer takes
        // two bytes, so the line to the client is idle between the answers.
        let times: Vec<_> = desk.came.iter().map(|(at, _)| *at).collect();
        assert_eq!(times[1], ns(6, baud) + ns(2, baud));
        assert_eq!(times[3], ns(12, baud) + ns(2, baud));
        let start = desk.now_ns;
        let mut desk = Desk::new("okline", Some(baud as u32));
        desk.talk(b"");
        let banner = desk.came[11].0;
        assert_eq!(
            banner,
            20_000_000 + ns(12, baud),
            "arrival of the line okline 1.0"
        );
        assert!(desk.now_ns > start);
    }
}

#[test]
fn a_trigger_starts_when_its_line_has_arrived() {
    let mut desk = Desk::new("scpi", Some(9600));
    let line = b"TRIG:SOUR BUS;:INIT;*TRG\n";
    desk.machine.receive(line, 0);
    // The time of the trigger does not depend on how late the device is advanced.
    desk.machine.advance(10_000_000_000);
    let exposures = desk.machine.take_exposures(10_000_000_000);
    assert_eq!(exposures.len(), 13);
    assert_eq!(exposures[0].shot.start_ns, ns(line.len() as u64, 9600));
}

#[test]
fn banner_is_sent_again_after_a_power_cycle() {
    let mut desk = Desk::new("okline", None);
    assert_eq!(desk.line("mark 9"), format!("ok\r\n{BANNER}"));
    desk.machine.power_cycle(desk.now_ns);
    assert_eq!(desk.line("mark?"), format!("ok 0\r\n{BANNER}"));
}

#[test]
fn waiting_commands_are_bounded() {
    let mut desk = Desk::new("okline", None);
    desk.talk(b"");
    desk.line("source soft");
    desk.line("arm");
    assert_eq!(desk.line("wait"), "");
    let replies = desk.talk(&b"gain?\n".repeat(100));
    let replies = String::from_utf8(replies).unwrap();
    let refused = replies
        .lines()
        .filter(|l| l.starts_with("error 13"))
        .count();
    assert_eq!((refused, replies.lines().count()), (100 - 63, 100 - 63));
}

#[test]
fn unknown_device_commands_are_refused_with_their_line() {
    let text = Dialect::text("okline").unwrap();
    let text = text.replace("runs = [\"*RST\"]", "runs = [\"CAMera:NONSense 1\"]");
    let line = 1 + text.lines().position(|l| l.contains("NONSense")).unwrap();
    let dialect = Dialect::parse(&text, "mine.toml").unwrap();
    let error = Port::new(Arc::new(dialect)).unwrap_err().to_string();
    assert!(error.contains(&format!("mine.toml:{line}")), "{error}");
    assert!(error.contains("-113"), "{error}");
    assert!(
        error.contains("expected SCPI commands of the device, such as"),
        "{error}"
    );
    for name in Dialect::names() {
        Port::new(Arc::new(Dialect::load(name).unwrap())).unwrap();
    }
}
