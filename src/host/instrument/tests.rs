use super::super::MemoryPort;
use super::*;
use std::time::Duration;

const SHORT: Duration = Duration::from_millis(30);
const LONG: Duration = Duration::from_secs(60);

/// Splits a query into its number and body.
fn question(line: &[u8]) -> Option<(u8, String)> {
    let line = String::from_utf8_lossy(line);
    let (tag, body) = line.trim().strip_prefix("*ESE ")?.split_once(";*ESE?;")?;
    Some((tag.parse().ok()?, body.to_owned()))
}

/// Answers each line from a list; an empty answer in the list means silence. A line that is not in
/// the list is executed if it is a command, and refused if it is a query.
fn answer(line: &[u8], answers: &[(&str, &[u8])]) -> Vec<u8> {
    if line.ends_with(b"*ESE 85;*ESE?;*ESE 0;*ESE?\n") {
        return b"stale\n85;0\r\n".to_vec();
    }
    let Some((tag, body)) = question(line) else {
        return Vec::new();
    };
    let mut reply = tag.to_string().into_bytes();
    for unit in body.split(";:") {
        match answers.iter().find(|(known, _)| *known == unit) {
            Some((_, b"")) => return Vec::new(),
            Some((_, answer)) => {
                reply.push(b';');
                reply.extend_from_slice(answer);
            }
            None if unit.ends_with('?') => break,
            None => {}
        }
    }
    reply.extend_from_slice(b"\r\n");
    reply
}

/// An instrument that answers each line from a list.
fn instrument(
    answers: &'static [(&'static str, &'static [u8])],
) -> Instrument<MemoryPort<impl FnMut(&[u8]) -> Vec<u8>>> {
    Instrument::open(MemoryPort::new(|line: &[u8]| answer(line, answers)), SHORT).unwrap()
}

const FINE: (&str, &[u8]) = ("SYST:ERR?", b"0,\"No error\"");

#[test]
fn queries_return_lines_and_blocks_or_name_the_error() {
    let mut fine = instrument(&[
        ("*IDN?", b"a,b,c,d"),
        ("DATA?", b"#15a\n;#9"),
        ("CR?", b"#11\r"),
        ("LINE?", b"text"),
        ("NOISE?", b"\xff\xfe"),
        ("SILENT?", b""),
        FINE,
    ]);
    assert_eq!(fine.query("*IDN?").unwrap(), "a,b,c,d");
    assert_eq!(fine.query_block("DATA?").unwrap().unwrap(), b"a\n;#9");
    assert_eq!(fine.query_block("CR?").unwrap().unwrap(), b"\r");
    fine.order("*RST").unwrap();
    for (result, needle) in [
        (fine.query("SILENT?"), "no answer to SILENT? within 0.03 s"),
        (fine.query("NOISE?"), "not an answer to it"),
        (fine.query("NONE?"), "NONE? was answered with \"\""),
        (fine.query_block("LINE?").map(|_| String::new()), "LINE?"),
    ] {
        let message = result.unwrap_err().to_string();
        assert!(message.contains(needle), "{needle} not in: {message}");
    }
    let mut refuses = instrument(&[("SYST:ERR?", b"-222,\"Data out of range;x\"")]);
    let message = refuses.order("CAM:EXP 9").unwrap_err().to_string();
    assert!(
        message.contains("-222,\"Data out of range;x\""),
        "{message}"
    );
    assert!(message.contains("CAM:EXP 9"), "{message}");
}

/// The device of this test reports each unknown query once.
#[test]
fn unknown_block_query_returns_none() {
    let mut complained = false;
    let device = move |line: &[u8]| {
        let unknown = question(line).is_some_and(|(_, body)| body == "DATA?");
        let error: &[u8] = match complained {
            true => b"-113,\"Undefined header\"",
            false => b"0,\"No error\"",
        };
        let reply = answer(line, &[("SYST:ERR?", error)]);
        complained = unknown;
        reply
    };
    let mut unknown = Instrument::open(MemoryPort::new(device), SHORT).unwrap();
    assert_eq!(unknown.query_block("DATA?").unwrap(), None);
}

#[test]
fn a_device_s_words_cannot_steer_a_terminal() {
    let mut instrument = instrument(&[(
        "SYST:ERR?",
        b"-300,\"\x1b]0;owned\x07\x1b[2J\xc2\x9b1m\xe2\x80\xae\r\xc3\xa9\\\"",
    )]);
    let message = instrument.check("*RST").unwrap_err().to_string();
    assert!(!message.contains(char::is_control), "{message:?}");
    assert!(!message.contains('\u{202e}'), "{message:?}");
    let needle = "-300,\"\\u{1b}]0;owned\\u{7}\\u{1b}[2J\\u{9b}1m\\u{202e}\\r\u{e9}\\\"";
    assert!(message.contains(needle), "{message}");
}

/// Answers every query with an error, each after a pause.
struct Complainer {
    pause: Duration,
    asked: Option<u8>,
    answered: u32,
}

impl CommandPort for Complainer {
    fn info(&self) -> &str {
        "complainer"
    }

    fn send(&mut self, bytes: &[u8], _timeout: Duration) -> Result<()> {
        self.asked = question(bytes).map(|(tag, _)| tag);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        std::thread::sleep(self.pause.min(timeout));
        let Some(tag) = self.asked.filter(|_| self.pause <= timeout) else {
            return Ok(0);
        };
        self.asked = None;
        self.answered += 1;
        let reply = format!("{tag};-300,\"no. {}\"\n", self.answered);
        buffer[..reply.len()].copy_from_slice(reply.as_bytes());
        Ok(reply.len())
    }
}

#[test]
fn a_device_that_goes_on_complaining_is_cut_short() {
    for (pause, timeout, needle) in [
        (Duration::ZERO, LONG, "-300,\"no. 133\"; and 59 more"),
        (SHORT / 4, SHORT, "-300,\"no. "),
    ] {
        let port = Complainer {
            pause,
            asked: None,
            answered: 0,
        };
        let mut instrument = Instrument::new(port, timeout);
        let start = Instant::now();
        let message = instrument.order("*RST").unwrap_err().to_string();
        assert!(message.contains(needle), "{message}");
        assert!(message.matches("-300").count() <= 5, "{message}");
        assert!(start.elapsed() < 20 * SHORT, "{:?}", start.elapsed());
    }
}

#[test]
fn a_device_that_never_stops_is_given_up() {
    let endless = MemoryPort::new(|_: &[u8]| vec![b'x'; 1 << 20]);
    let mut instrument = Instrument::new(endless, SHORT);
    let message = instrument.query("*IDN?").unwrap_err().to_string();
    assert!(message.contains("not a reply"), "{message}");
    let huge = MemoryPort::new(|line: &[u8]| {
        let (tag, _) = question(line).unwrap();
        format!("{tag};#9999999999").into_bytes()
    });
    let mut instrument = Instrument::new(huge, SHORT);
    let message = instrument.query_block("DATA?").unwrap_err().to_string();
    assert!(message.contains("a block of 999999999 bytes"), "{message}");
}

/// An instrument behind `line`, which changes each reply; its second argument is the number of the
/// reply.
fn through(
    line: impl Fn(Vec<u8>, u32) -> Vec<u8> + 'static,
) -> Instrument<MemoryPort<impl FnMut(&[u8]) -> Vec<u8>>> {
    let mut count = 0;
    let device = move |sent: &[u8]| {
        let reply = answer(
            sent,
            &[
                ("A?", b"first"),
                ("B?", b"second"),
                ("DATA?", b"#212period = 16\n"),
                FINE,
            ],
        );
        if question(sent).is_none() || sent.starts_with(b"\n*CLS") {
            return reply;
        }
        count += 1;
        line(reply, count)
    };
    Instrument::open(MemoryPort::new(device), SHORT).unwrap()
}

#[test]
fn damaged_or_repeated_replies_do_not_give_wrong_answers() {
    let odd = |n: u32| n % 2 == 1;
    type Line = Box<dyn Fn(Vec<u8>, u32) -> Vec<u8>>;
    let bad: Vec<(&str, Line)> = vec![
        (
            "lost",
            Box::new(move |r, n| if odd(n) { Vec::new() } else { r }),
        ),
        ("twice", Box::new(|r, _| [r.clone(), r].concat())),
        (
            "garbage before",
            Box::new(move |r, n| {
                if odd(n) {
                    [&b"\xff#9"[..], &r].concat()
                } else {
                    r
                }
            }),
        ),
        (
            "a block's head before",
            Box::new(move |r, n| {
                if odd(n) {
                    [&b"#19"[..], &r].concat()
                } else {
                    r
                }
            }),
        ),
        (
            "half",
            Box::new(
                move |r, n| {
                    if odd(n) { r[..r.len() / 2].to_vec() } else { r }
                },
            ),
        ),
        (
            "an older answer first",
            Box::new(|r, _| [&b"200;second\r\n201;#11x\r\n"[..], &r].concat()),
        ),
    ];
    for (what, line) in bad {
        let mut instrument = through(line);
        for _ in 0..5 {
            assert_eq!(instrument.query("A?").unwrap(), "first", "{what}");
            assert_eq!(instrument.query("B?").unwrap(), "second", "{what}");
            let block = instrument.query_block("DATA?").unwrap().unwrap();
            assert_eq!(block, b"period = 16\n", "{what}");
            instrument.order("ABOR").unwrap();
        }
    }
}

/// Each reply arrives only when the next query is sent.
#[test]
fn a_late_reply_answers_its_own_question_only() {
    let mut late = Vec::new();
    let device = move |sent: &[u8]| {
        let reply = answer(sent, &[("A?", b"first"), ("B?", b"second")]);
        match question(sent) {
            Some(_) if !sent.starts_with(b"\n*CLS") => std::mem::replace(&mut late, reply),
            _ => reply,
        }
    };
    let mut instrument = Instrument::open(MemoryPort::new(device), SHORT).unwrap();
    for _ in 0..3 {
        assert_eq!(instrument.query("A?").unwrap(), "first");
        assert_eq!(instrument.query("B?").unwrap(), "second");
    }
}

/// A device that sends a greeting, and then, after a delay, the answer.
struct Chatty {
    greeting: &'static [u8],
    asked: u32,
    /// Messages to send, each with the wait that precedes it.
    said: std::collections::VecDeque<(Duration, Vec<u8>)>,
}

impl CommandPort for Chatty {
    fn info(&self) -> &str {
        "chatty"
    }

    fn send(&mut self, bytes: &[u8], _: Duration) -> Result<()> {
        match question(bytes) {
            Some((tag, body)) if body == "LINE?" => {
                self.asked += 1;
                let pause = Duration::from_millis(400);
                let answer = format!("{tag};text\n").into_bytes();
                self.said
                    .push_back((Duration::ZERO, self.greeting.to_vec()));
                self.said.push_back((pause, answer));
            }
            _ => self
                .said
                .push_back((Duration::ZERO, answer(bytes, &[FINE]))),
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        match self.said.front() {
            Some((pause, _)) if *pause <= timeout => {}
            _ => return Ok(0),
        }
        let (_, bytes) = self.said.pop_front().unwrap_or_default();
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }
}

#[test]
fn power_on_message_is_not_taken_for_a_damaged_answer() {
    let known: Vec<Vec<u8>> = vec![b"Ready.\n".to_vec(), b"> ".to_vec(), b"A\r\nB\r\n".to_vec()];
    for (greeting, asked) in [
        (&b"Ready.\n"[..], 1),
        (b"Ready.\r\n", 1),
        (b"> ", 1),
        (b"Ready.\nReady.\n> ", 1),
        (b"A\r\nB\r\n", 1),
        (b"B\n", 1),
        // A line that is not a known power-on message may be the rest of a corrupted answer, so the
        // query is repeated soon.
        (b"Read\n", 2),
        (b"Ready.!\n", 2),
    ] {
        let port = Chatty {
            greeting,
            asked: 0,
            said: Default::default(),
        };
        let mut chatty = Instrument::open_chatty(port, known.clone(), LONG).unwrap();
        let words = greeting.escape_ascii();
        assert_eq!(chatty.query("LINE?").unwrap(), "text", "{words}");
        assert_eq!(chatty.port.asked, asked, "{words}");
    }
}
