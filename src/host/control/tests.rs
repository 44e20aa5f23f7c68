//! The SCPI operations on an unreliable line, with a device that is a set of settings.

use super::*;
use crate::MemoryPort;
use phasmid_protocol::dialect::{Cut, Direction};
use std::cell::{Cell, RefCell};
use std::rc::Rc;

const SHORT: Duration = Duration::from_millis(3);
const MANIFEST: &str = "period = 16\nphase = 1.25\n";

/// The settings of a device.
struct Device {
    selected: String,
    source: String,
    lamp: bool,
    events: u8,
    enabled: u8,
    /// The device has received a query that it does not know.
    unknown: bool,
    /// Number of messages that the device has answered.
    asked: u32,
}

impl Device {
    fn on() -> Self {
        Self {
            selected: "a".into(),
            source: "INT".into(),
            lamp: true,
            events: 128,
            enabled: 0,
            unknown: false,
            asked: 0,
        }
    }

    /// Processes one message like an IEEE 488.2 parser; returns the answers, up to the first error.
    fn message(&mut self, message: &str) -> Option<String> {
        let mut answers = Vec::new();
        for unit in message.split(';') {
            let unit = unit.trim().trim_start_matches(':');
            if let Some(number) = unit.strip_prefix("*ESE ") {
                self.enabled = number.parse().ok()?;
                continue;
            }
            let answer = match unit {
                "INIT:CONT OFF" | "ABOR" | "MODE SEQ" | "TRIG:MODE SEQ" | "" => continue,
                "*CLS" => {
                    self.events = 0;
                    continue;
                }
                "TRIG:SOUR BUS" => {
                    self.source = "BUS".into();
                    continue;
                }
                "PROJ:POW ON" | "PROJ:POW 1" => {
                    self.lamp = true;
                    continue;
                }
                "SEQ:SEL \"a\"" | "SEQ:SEL \"c\"" => {
                    self.selected = unit.chars().rev().nth(1)?.into();
                    continue;
                }
                "*ESE?" => self.enabled.to_string(),
                "*IDN?" => "maker,model,1,2".into(),
                "SEQ:SEL?" => format!("\"{}\"", self.selected),
                "SEQ:LIST?" => "\"a\",\"c\"".into(),
                "TRIG:SOUR?" => self.source.clone(),
                "TRIG:MODE?" => "SEQ".into(),
                "INIT:CONT?" => "0".into(),
                "PROJ:POW?" => u8::from(self.lamp).to_string(),
                "*ESR?" => std::mem::take(&mut self.events).to_string(),
                "SYST:ERR?" => match std::mem::take(&mut self.unknown) {
                    true => "-113,\"Undefined header\"".into(),
                    false => "0,\"No error\"".into(),
                },
                "SEQ:DATA?" => format!("#2{}{MANIFEST}", MANIFEST.len()),
                _ => {
                    self.unknown = true;
                    break;
                }
            };
            answers.push(answer);
        }
        (!answers.is_empty()).then(|| answers.join(";") + "\n")
    }

    fn receive(&mut self, bytes: &[u8]) -> Vec<u8> {
        let text = String::from_utf8_lossy(bytes);
        let replies: String = text.lines().filter_map(|line| self.message(line)).collect();
        self.asked += u32::from(!replies.is_empty());
        replies.into_bytes()
    }
}

/// A device that speaks a dialect.
fn behind_dialect<'a>(
    dialect: &Dialect,
    from: impl Fn(Vec<u8>, u32) -> Vec<u8> + 'a,
) -> (Control<MemoryPort<Reaction<'a>>>, Shared) {
    let device = Rc::new(RefCell::new(Device::on()));
    let (inside, spoken) = (device.clone(), dialect.clone());
    let mut cutter = dialect.cutter(Direction::ToDevice);
    let reaction: Reaction<'a> = Box::new(move |bytes: &[u8]| {
        let mut device = inside.borrow_mut();
        let mut replies = Vec::new();
        cutter.push(bytes, &mut |cut| {
            let Cut::Message(message) = cut else { return };
            replies.extend(match spoken.asked(&message) {
                Err(wrong) => spoken.nack(&wrong),
                Ok(asked) => {
                    let runs = spoken.runs(&asked);
                    let answers: Vec<_> = runs
                        .iter()
                        .map(|run| device.message(run).unwrap_or_default())
                        .map(|answer| answer.strip_suffix('\n').unwrap_or("").as_bytes().to_vec())
                        .collect();
                    let refused = |e| spoken.refusal(&asked, &e);
                    spoken.answer(&asked, &answers).unwrap_or_else(refused)
                }
            });
        });
        device.asked += 1;
        from(replies, device.asked)
    });
    let port = MemoryPort::new(reaction);
    let control = Control::open(port, Some(dialect.clone()), SHORT).unwrap();
    (control, device)
}

type Shared = Rc<RefCell<Device>>;
/// The device's reaction to received bytes.
type Reaction<'a> = Box<dyn FnMut(&[u8]) -> Vec<u8> + 'a>;

/// A device behind a line that changes data: `to` changes data to the device, `from` changes data
/// from it.
fn behind<'a>(
    to: impl Fn(&[u8], &Shared) -> Vec<u8> + 'a,
    from: impl Fn(Vec<u8>, u32) -> Vec<u8> + 'a,
) -> (Control<MemoryPort<Reaction<'a>>>, Shared) {
    let device = Rc::new(RefCell::new(Device::on()));
    let inside = device.clone();
    let reaction: Reaction<'a> = Box::new(move |bytes: &[u8]| {
        let bytes = to(bytes, &inside);
        let mut device = inside.borrow_mut();
        let replies = device.receive(&bytes);
        from(replies, device.asked)
    });
    let port = MemoryPort::new(reaction);
    (Control::open(port, None, SHORT).unwrap(), device)
}

fn good(bytes: &[u8], _: &Shared) -> Vec<u8> {
    bytes.to_vec()
}

#[test]
fn no_flipped_bit_of_a_reply_changes_the_manifest() {
    let (mut whole, _) = behind(good, |reply, _| reply);
    assert_eq!(whole.manifest().unwrap().unwrap().0, MANIFEST);
    // The device's second answer, which is damaged below, is the first reading of the manifest.
    let len = format!("1;#226{MANIFEST}\n").len();
    for bit in 0..8 * len {
        let (mut control, device) = behind(good, move |mut reply, n| {
            if n == 2 {
                reply[bit / 8] ^= 1 << (bit % 8);
            }
            reply
        });
        let (manifest, _) = control.manifest().unwrap().unwrap();
        assert_eq!(manifest, MANIFEST, "bit {bit}");
        assert!(device.borrow().asked >= 3);
    }
}

#[test]
fn readings_that_never_agree_are_reported() {
    let (mut control, _) = behind(good, |mut reply, n| {
        let last = reply.len() - 2;
        if n > 1 {
            reply[last] ^= n as u8;
        }
        reply
    });
    let message = control.manifest().unwrap_err().to_string();
    assert!(message.contains("no two of which agree"), "{message}");
}

/// Flips, one at a time, every bit of every byte that is exchanged to prepare a run, in either
/// direction.
#[test]
fn no_flipped_bit_prepares_another_run() {
    for to_device in [true, false] {
        for nth in 2..14 {
            for bit in 0..8 * 60 {
                let struck = Rc::new(RefCell::new(0));
                let count = struck.clone();
                let flip = move |bytes: &mut Vec<u8>| {
                    *count.borrow_mut() += 1;
                    if *count.borrow() == nth
                        && let Some(byte) = bytes.get_mut(bit / 8)
                    {
                        *byte ^= 1 << (bit % 8);
                    }
                };
                let (mut control, device) = behind(
                    {
                        let flip = flip.clone();
                        move |bytes, _| {
                            let mut bytes = bytes.to_vec();
                            if to_device {
                                flip(&mut bytes);
                            }
                            bytes
                        }
                    },
                    move |mut reply, _| {
                        if !to_device {
                            flip(&mut reply);
                        }
                        reply
                    },
                );
                let prepared = control.persist(|control| control.prepare(Some("c")));
                // The host may give up, but must not prepare another run.
                if let Ok(settings) = prepared {
                    let device = device.borrow();
                    assert_eq!(device.selected, "c", "{to_device} {nth} {bit}");
                    assert_eq!(device.source, "BUS", "{to_device} {nth} {bit}");
                    assert_eq!(control.selected(&settings).unwrap(), "c");
                }
            }
        }
    }
}

#[test]
fn a_device_that_was_reset_is_found_out() {
    let (mut control, device) = behind(good, |reply, _| reply);
    let settings = control.prepare(Some("c")).unwrap();
    control.confirm(&settings).unwrap();
    *device.borrow_mut() = Device::on();
    let message = control.confirm(&settings).unwrap_err().to_string();
    assert!(message.contains("was reset"), "{message}");
    assert!(message.contains("SEQ:SEL?"), "{message}");
    // A device whose settings survive still reports that it was power-cycled.
    let settings = control.prepare(Some("c")).unwrap();
    device.borrow_mut().events = 128;
    assert!(control.confirm(&settings).is_err());
    // A power cycle while the run is being prepared is detected too.
    let (mut control, _) = behind(
        |bytes, device| {
            if bytes.ends_with(b"SEQ:SEL \"c\";:SYST:ERR?\n") {
                let asked = device.borrow().asked;
                *device.borrow_mut() = Device {
                    asked,
                    ..Device::on()
                };
            }
            bytes.to_vec()
        },
        |reply, _| reply,
    );
    let message = control.prepare(Some("c")).unwrap_err().to_string();
    assert!(message.contains("not what was set"), "{message}");
}

#[test]
fn unknown_sequence_is_a_usage_error() {
    let (mut control, _) = behind(good, |reply, _| reply);
    let error = control.prepare(Some("z")).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    assert!(error.to_string().ends_with("expected a, c"), "{error}");
}

#[test]
fn names_in_lists_may_contain_commas() {
    assert_eq!(names("\"a\"\"b\",\"c, d\""), ["a\"b", "c, d"]);
    assert_eq!(names("a, b c"), ["a", "b c"]);
    assert_eq!(names("a, \"b, c\",d"), ["a", "b, c", "d"]);
}

/// Skips a setting that the device does not know, and reads the other settings back.
#[test]
fn unknown_settings_are_left_out() {
    let (mut control, device) = behind(
        |bytes, _| {
            let line = String::from_utf8_lossy(bytes);
            line.replace("TRIG:MODE?", "NONE?").into_bytes()
        },
        |reply, _| reply,
    );
    let settings = control.prepare(Some("c")).unwrap();
    device.borrow_mut().lamp = false;
    let message = control.confirm(&settings).unwrap_err().to_string();
    assert!(message.contains("PROJ:POW? says \"0\""), "{message}");
}

const DIALECTS: [&str; 2] = ["okline", "dlpc350"];

/// Performs every query that is made before and after a run.
fn talk<P: CommandPort>(control: &mut Control<P>) -> Result<()> {
    assert_eq!(control.identify()?, "maker,model,1,2");
    let settings = control.prepare(Some("c"))?;
    assert_eq!(control.selected(&settings).unwrap(), "c");
    assert_eq!(control.manifest()?.unwrap().0, MANIFEST);
    control.confirm(&settings)
}

#[test]
fn dialects_do_as_scpi_does() {
    for name in DIALECTS {
        let dialect = Dialect::load(name).unwrap();
        let (mut control, device) = behind_dialect(&dialect, |reply, _| reply);
        assert_eq!(control.source().unwrap().unwrap(), "INT", "{name}");
        talk(&mut control).unwrap();
        assert_eq!(device.borrow().source, "BUS", "{name}");
        assert_eq!(device.borrow().selected, "c", "{name}");
        let settings = control.prepare(None).unwrap();
        assert_eq!(control.selected(&settings).unwrap(), "c", "{name}");
        *device.borrow_mut() = Device::on();
        let message = control.confirm(&settings).unwrap_err().to_string();
        assert!(message.contains("was reset"), "{name}: {message}");
        let error = control.prepare(Some("z")).unwrap_err();
        assert!(!matches!(error, Error::Io { .. }), "{name}: {error}");
    }
}

#[test]
fn bad_lines_do_not_fool_dialects() {
    type Line = Box<dyn Fn(Vec<u8>, u32, u32) -> Vec<u8>>;
    let bad: Vec<(&str, Line)> = vec![
        (
            "lost",
            Box::new(|r, n, nth| if n == nth { Vec::new() } else { r }),
        ),
        (
            "twice",
            Box::new(|r, n, nth| if n == nth { [r.clone(), r].concat() } else { r }),
        ),
        ("all twice", Box::new(|r, _, _| [r.clone(), r].concat())),
        (
            "garbage before",
            Box::new(|r, n, nth| {
                if n == nth {
                    [&b"\xff#9\r\n"[..], &r].concat()
                } else {
                    r
                }
            }),
        ),
        (
            "half",
            Box::new(|mut r, n, nth| {
                if n == nth {
                    r.truncate(r.len() / 2);
                }
                r
            }),
        ),
        (
            "a flipped bit",
            Box::new(|mut r, n, nth| {
                if n == nth && r.len() > 8 {
                    r[nth as usize % 9] ^= 1 << (nth % 7);
                }
                r
            }),
        ),
    ];
    for name in DIALECTS {
        let dialect = Dialect::load(name).unwrap();
        for (what, line) in &bad {
            for nth in 1..30 {
                let line = |reply, n| line(reply, n, nth);
                let (mut control, device) = behind_dialect(&dialect, line);
                let talked = control.persist(talk);
                talked.unwrap_or_else(|e| panic!("{name} {what} at {nth}: {e}"));
                assert_eq!(device.borrow().source, "BUS", "{name} {what} at {nth}");
            }
        }
    }
}

/// A power-on message in the middle of a run does not make the run fail; a power cycle does,
/// whatever the device sends.
#[test]
fn power_on_message_alone_is_not_taken_for_a_reset() {
    let okline = Dialect::load("okline").unwrap();
    for nth in 1..30 {
        let late = |reply: Vec<u8>, n| match n == nth {
            true => [&b"ready\r\n"[..], &reply].concat(),
            false => reply,
        };
        let (mut control, _) = behind_dialect(&okline, late);
        talk(&mut control).unwrap_or_else(|e| panic!("at {nth}: {e}"));
    }
    // With a dialect that cannot set a mark, the power-on message is the only evidence.
    let text = Dialect::text("okline").unwrap();
    let kept = text.lines().filter(|line| !line.starts_with("mark"));
    let unmarked = Dialect::parse(&kept.collect::<Vec<_>>().join("\n"), "it").unwrap();
    for (dialect, found) in [(&okline, false), (&unmarked, true)] {
        let boots = Rc::new(RefCell::new(false));
        let says = boots.clone();
        let (mut control, _) = behind_dialect(dialect, move |reply, _| match *says.borrow() {
            true => [&b"ready\r\n"[..], &reply].concat(),
            false => reply,
        });
        let settings = control.prepare(None).unwrap();
        *boots.borrow_mut() = true;
        assert_eq!(control.confirm(&settings).is_err(), found);
    }
}

/// A restart of a device that keeps its settings is detected by the mark, even if the host had to
/// synchronize and set another mark.
#[test]
fn a_reset_behind_a_lost_answer_is_found_out() {
    let dialect = Dialect::load("okline").unwrap();
    for lost in [0, 1] {
        for reset in [false, true] {
            let left = Rc::new(Cell::new(0u32));
            let count = left.clone();
            let (mut control, device) = behind_dialect(&dialect, move |reply, _| {
                let lose = count.get() > 0;
                count.set(count.get().saturating_sub(1));
                if lose { Vec::new() } else { reply }
            });
            let settings = control.prepare(Some("c")).unwrap();
            if reset {
                device.borrow_mut().enabled = 0;
            }
            left.set(lost);
            let found = control.confirm(&settings);
            assert_eq!(found.is_err(), reset, "{lost}: {found:?}");
        }
    }
}
