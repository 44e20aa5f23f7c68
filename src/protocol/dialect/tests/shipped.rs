use super::super::{Asked, Dialect, Direction, Event, Gather, Reply, Value};
use super::{messages, only};
use crate::scpi::{DeviceError, ErrorCode, encode_block};

fn load(name: &str) -> Dialect {
    Dialect::load(name).unwrap()
}

fn asked(dialect: &Dialect, command: &str, args: &[(&str, Value)]) -> Asked {
    let request = dialect.request(command, args, 5).unwrap();
    dialect
        .asked(&only(dialect, Direction::ToDevice, &request))
        .unwrap()
}

#[test]
fn units_are_converted_to_those_of_the_device() {
    let okline = load("okline");
    for (line, run) in [
        ("exposure 8000", "CAM:EXP 0.008"),
        ("EXPOSURE 20", "CAM:EXP 0.00002"),
        ("current 12.5", "PROJ:CURR 0.125"),
        ("gain 6.5", "CAM:GAIN 6.5"),
        ("lamp on", "PROJ:POW 1"),
        ("source free", "TRIG:SOUR INT"),
        ("select a\"b", "SEQ:SEL \"a\"\"b\""),
        ("stop", "INIT:CONT OFF;:ABOR"),
    ] {
        let asked = okline.asked(line.as_bytes()).unwrap();
        assert_eq!(okline.runs(&asked), [run], "{line}");
    }
    let asked = okline.asked(b"exposure?").unwrap();
    let reply = okline.answer(&asked, &[b"0.0333333333".to_vec()]).unwrap();
    assert_eq!(reply, b"ok 33333\r\n");
    let dlpc = load("dlpc350");
    let args = [("exposure", 0.008.into()), ("period", 0.01.into())];
    let packet = dlpc.request("timing", &args, 7).unwrap();
    let head = [
        0x40, 7, 10, 0, 0x29, 0x1A, 0x40, 0x1F, 0, 0, 0x10, 0x27, 0, 0,
    ];
    assert_eq!(packet[..14], head);
    assert!(packet.len() == 64 && packet[14..].iter().all(|b| *b == 0));
    let runs = dlpc.runs(&dlpc.asked(&packet).unwrap());
    assert_eq!(runs, ["CAM:EXP MIN", "SEQ:PER 0.01", "CAM:EXP 0.008"]);
    let reply = dlpc.answer(&dlpc.asked(&packet).unwrap(), &[]).unwrap();
    assert_eq!(reply[..4], [0x40, 7, 0, 0]);
}

#[test]
fn refusals_have_the_dialect_s_own_numbers() {
    let okline = load("okline");
    for (line, reply) in [
        ("moon", "error 11 unknown command\r\n"),
        ("exposure x", "error 12 bad argument\r\n"),
        ("exposure", "error 12 bad argument\r\n"),
        ("Select", "error 12 bad argument\r\n"),
        ("exposure 1 2", "error 12 bad argument\r\n"),
        ("version 3", "error 12 bad argument\r\n"),
        ("exposures 3", "error 11 unknown command\r\n"),
        ("exposure 0", "error 20 out of range\r\n"),
        ("lamp half", "error 20 out of range\r\n"),
    ] {
        let error = okline.asked(line.as_bytes()).unwrap_err();
        assert_eq!(okline.nack(&error), reply.as_bytes(), "{line}: {error}");
    }
    let fire = asked(&okline, "fire", &[]);
    let late = DeviceError::from(ErrorCode::TriggerIgnored);
    let refusal = okline.refusal(&fire, &late);
    assert_eq!(refusal, b"error 22 not now\r\n");
    assert_eq!(
        okline.reply("fire", &refusal, 0),
        Reply::Refused {
            number: 22,
            text: "not now".into()
        }
    );
    assert_eq!(okline.busy(&fire), b"error 2 busy\r\n");
    let system = DeviceError::from(ErrorCode::SystemError);
    assert_eq!(okline.refusal(&fire, &system), b"error 1 failed\r\n");

    let dlpc = load("dlpc350");
    let select = asked(&dlpc, "select", &[("name", "moon".into())]);
    let refusal = dlpc.refusal(&select, &DeviceError::from(ErrorCode::FileNameNotFound));
    assert_eq!(refusal[..5], [0x60, 5, 1, 0, 11]);
    assert_eq!(
        dlpc.reply("select", &refusal, 5),
        Reply::Refused {
            number: 11,
            text: "not found".into()
        }
    );
    assert_eq!(dlpc.reply("select", &refusal, 6), Reply::Other);
    assert_eq!(dlpc.busy(&select)[4], 7);
    let mut unknown = dlpc.request("arm", &[], 5).unwrap();
    unknown[5] = 0x77;
    let error = dlpc.asked(&unknown).unwrap_err();
    assert_eq!(dlpc.nack(&error)[..5], [0x60, 5, 1, 0, 10]);
    // Flags of the request, and flags of the reply that refuses it (DLPU018, read operations).
    for (flags, refused) in [(0x40, 0x60), (0xC0, 0xE0)] {
        let mut beyond = dlpc.request("list?", &[("offset", 0.0.into())], 9).unwrap();
        beyond[0] = flags;
        let error = dlpc.asked(&beyond);
        let nack = match &error {
            Err(error) => dlpc.nack(error),
            Ok(asked) => dlpc.refusal(asked, &ErrorCode::DataOutOfRange.into()),
        };
        assert_eq!((nack[0], nack[1]), (refused, 9));
        unknown[0] = flags;
        let nack = dlpc.nack(&dlpc.asked(&unknown).unwrap_err());
        assert_eq!(nack[..5], [refused, 5, 1, 0, 10]);
    }
    unknown[0] = 0;
    assert!(dlpc.nack(&dlpc.asked(&unknown).unwrap_err()).is_empty());
    let mut long = dlpc.request("arm", &[], 5).unwrap();
    long[2] = 3;
    let error = dlpc.asked(&long).unwrap_err();
    assert_eq!(error.error.code, ErrorCode::ParameterNotAllowed);
}

/// A word reaches the firmware unchanged, so a word that contains a further message must be refused.
#[test]
fn a_word_is_no_message() {
    let text = Dialect::text("okline").unwrap();
    let old = "choices = { all = \"SEQ\", step = \"STEP\" }";
    let any_word = text.replace(&format!(", {old}"), "");
    assert_ne!(any_word, text);
    let dialect = Dialect::parse(&any_word, "words").unwrap();
    let fine = dialect.asked(b"mode SEQ").unwrap();
    assert_eq!(dialect.runs(&fine), ["TRIG:MODE SEQ"]);
    let error = dialect.asked(b"mode SEQ:*RST").unwrap_err();
    assert_eq!(dialect.nack(&error), b"error 20 out of range\r\n");
    let scpi = load("scpi");
    assert!(
        scpi.request("restore", &[("source", "INT;*RST".into())], 0)
            .is_err()
    );
}

#[test]
fn long_answers_come_in_pieces() {
    let toml: Vec<u8> = (0..3000u32).map(|i| (i * i % 251) as u8).collect();
    for (name, command, pieces) in [("okline", "manifest", 12), ("dlpc350", "manifest?", 58)] {
        let dialect = load(name);
        let chunk = dialect.chunk(command).unwrap();
        for (toml, pieces) in [(&toml[..], pieces), (&[], 1)] {
            let mut gather = Gather::new(chunk);
            let mut asks = 0;
            let whole = loop {
                asks += 1;
                let asked = asked(&dialect, command, &[gather.ask()]);
                let reply = dialect.answer(&asked, &[encode_block(toml)]).unwrap();
                let message = only(&dialect, Direction::ToHost, &reply);
                let Reply::Done(values) = dialect.reply(command, &message, 5) else {
                    panic!("{name}");
                };
                if let Some(whole) = gather.take(&values).unwrap() {
                    break whole;
                }
            };
            assert_eq!(whole, toml, "{name}");
            assert_eq!(asks, pieces, "{name}");
        }
        // A chunk of another answer, and a chunk with one changed digit, must be detected.
        let answer = |text: &[u8], offset: f64| {
            let asked = asked(&dialect, command, &[(&chunk.offset, offset.into())]);
            let reply = dialect.answer(&asked, &[encode_block(text)]).unwrap();
            let message = only(&dialect, Direction::ToHost, &reply);
            match dialect.reply(command, &message, 5) {
                Reply::Done(values) => values,
                other => panic!("{other:?}"),
            }
        };
        let mut gather = Gather::new(chunk);
        assert_eq!(gather.take(&answer(&toml, 0.0)).unwrap(), None);
        let words = gather.take(&answer(&toml[1..], 52.0)).unwrap_err();
        let words = words.to_string();
        assert!(words.contains("different transfers"), "{words}");
        let mut values = answer(b"12345", 0.0);
        for (_, value) in &mut values {
            if let Value::Bytes(bytes) = value {
                bytes[2] = b'8';
            }
        }
        let words = Gather::new(chunk).take(&values).unwrap_err().to_string();
        assert!(words.contains("checksum"), "{words}");
        let beyond = asked(&dialect, command, &[(&chunk.offset, 6.0.into())]);
        let error = dialect
            .answer(&beyond, &[b"#15abcde".to_vec()])
            .unwrap_err();
        assert_eq!(error.code, ErrorCode::DataOutOfRange);
    }
}

#[test]
fn events_and_boot_messages_are_not_taken_for_answers() {
    let okline = load("okline");
    let frame = Event::Exposed { index: 3, id: 41 };
    assert_eq!(okline.event(frame).unwrap(), b"!frame 3 41\r\n");
    assert_eq!(okline.reply("arm", b"!frame 3 41", 0), Reply::Event(frame));
    assert_eq!(
        okline.reply("arm", b"!done", 0),
        Reply::Event(Event::SequenceDone)
    );
    assert_eq!(okline.event(Event::Booted), None);
    let boot: Vec<_> = okline
        .boot()
        .iter()
        .map(|b| (b.delay_ns, &b.bytes[..]))
        .collect();
    assert_eq!(
        boot,
        [
            (20_000_000, &b"okline 1.0\r\n"[..]),
            (150_000_000, b"ready\r\n")
        ]
    );
    assert_eq!(
        okline.reply("arm", b"ready", 0),
        Reply::Event(Event::Booted)
    );
    assert_eq!(okline.reply("mark?", b"ok", 0), Reply::Other);
    assert_eq!(okline.reply("arm", b"ok", 0), Reply::Done(Vec::new()));
    assert!(matches!(okline.reply("mark?", b"ok 7x", 0), Reply::Bad(_)));
    assert!(matches!(
        okline.reply("mark?", b"gibberish", 0),
        Reply::Bad(_)
    ));
    assert_eq!(load("dlpc350").event(frame), None);
}

#[test]
fn echoes_are_not_taken_for_replies() {
    let text = Dialect::text("okline")
        .unwrap()
        .replace("echo = false", "echo = true");
    let echoing = Dialect::parse(&text, "echoing").unwrap();
    assert!(echoing.echo() && !load("okline").echo());
    assert_eq!(echoing.echoed(b"Mark? ; x"), b"Mark? ; x\r\n");
    assert_eq!(echoing.reply("mark?", b"mark?", 0), Reply::Other);
}

/// Every shipped dialect file defines the operations that a scan needs.
#[test]
fn every_dialect_can_do_a_scan() {
    for name in Dialect::names() {
        let dialect = load(name);
        let host = dialect.host();
        for operation in [
            "identify",
            "list",
            "selected",
            "manifest",
            "calibration",
            "source",
        ] {
            assert!(host.get(operation).is_some(), "{name}: {operation}");
        }
        let inputs = [
            ("name", Value::from("quick-4")),
            ("source", "INT".into()),
            ("exposure", 0.004.into()),
            ("mark", 85.0.into()),
        ];
        for operation in [
            "select", "restore", "quiet", "light_on", "arm", "trigger", "mark", "exposure",
        ] {
            for step in &host.get(operation).unwrap().steps {
                let args = step.args(&inputs).unwrap();
                dialect.request(&step.command, &args, 0).unwrap();
            }
        }
        assert!(
            host.get("restore")
                .unwrap()
                .steps
                .iter()
                .any(|step| step.args(&[]).is_err())
        );
    }
    let okline = load("okline");
    let identify = okline.host().get("identify").unwrap();
    let asked = asked(&okline, "version", &[]);
    let bytes = okline.answer(&asked, &[b"A,B c,D,1.0".to_vec()]).unwrap();
    assert_eq!(bytes, b"scanner A,B c,D,1.0\r\nok\r\n");
    let lines = messages(&okline, Direction::ToHost, &bytes, 1);
    let Reply::More(values) = okline.reply("version", &lines[0], 0) else {
        panic!("{lines:?}");
    };
    assert_eq!(
        okline.reply("version", &lines[1], 0),
        Reply::Done(Vec::new())
    );
    assert_eq!(identify.result(&values), Some("A,B c,D,1.0".into()));
    assert_eq!(identify.result(&values[1..]), None);
}
