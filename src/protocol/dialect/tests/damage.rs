use super::super::{Cut, Dialect, Direction, Reply, Value};
use super::{DIALECTS, checked, messages};
use crate::scpi::ErrorCode;
use proptest::prelude::*;

const CHECKSUMS: [&str; 4] = ["sum8", "xor8", "crc16-ccitt", "crc32"];

fn set(dialect: &Dialect) -> Vec<u8> {
    let args = [
        ("a", Value::Number(0.25)),
        ("b", Value::Number(-7.0)),
        ("word", "1".into()),
        ("name", "quick-4".into()),
    ];
    dialect.request("set", &args, 9).unwrap()
}

fn got(dialect: &Dialect) -> Vec<u8> {
    let request = dialect.request("get", &[], 3).unwrap();
    let asked = dialect.asked(&request).unwrap();
    let answers = [b"0.5".to_vec(), b"-3;#13xyz".to_vec()];
    dialect.answer(&asked, &answers).unwrap()
}

#[test]
fn every_flipped_bit_of_a_checked_packet_is_refused() {
    for kind in CHECKSUMS {
        let dialect = checked(kind);
        let (request, reply) = (set(&dialect), got(&dialect));
        assert!(dialect.asked(&request).is_ok());
        let values = dialect.reply("get", &reply, 3);
        assert!(matches!(&values, Reply::Done(values) if values[1].1 == Value::Number(-3.0)));
        for bit in 0..8 * request.len() {
            let mut bad = request.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            let error = dialect.asked(&bad).unwrap_err();
            assert!(!error.wants_reply && dialect.nack(&error).is_empty());
            // A flipped bit in the length field moves the end of the packet, so that an 8-bit sum
            // may match by chance.
            if kind.starts_with("crc") {
                let stream = [&bad[..], &bad, &request].concat();
                let passed = messages(&dialect, Direction::ToDevice, &stream, 11);
                assert!(passed.iter().all(|m| *m == request), "{kind} bit {bit}");
            }
        }
        for bit in 0..8 * reply.len() {
            let mut bad = reply.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            let verdict = dialect.reply("get", &bad, 3);
            assert!(
                matches!(verdict, Reply::Bad(_)),
                "{kind} bit {bit}: {verdict:?}"
            );
        }
    }
}

#[test]
fn garbage_before_a_message_is_dropped_and_reported_once() {
    let okline = Dialect::load("okline").unwrap();
    let mut stream = vec![b'x'; 5000];
    stream.extend_from_slice(b"\r\n\n  ; nothing\nmark? ; a question\r\n");
    let mut cutter = okline.cutter(Direction::ToDevice);
    let mut cuts = Vec::new();
    cutter.push(&stream, &mut |cut| cuts.push(cut));
    let [Cut::Dropped(error), Cut::Message(line)] = &cuts[..] else {
        panic!("{cuts:?}")
    };
    assert_eq!(error.error.code, ErrorCode::InputBufferOverrun);
    assert_eq!(okline.nack(error), b"error 13 line too long\r\n");
    assert_eq!(okline.asked(line).unwrap().command, "mark?");

    let dialect = checked("crc16-ccitt");
    let packet = set(&dialect);
    let stream = [
        &b"noise \xAA\x55\x00"[..],
        &packet,
        b"\xAA",
        &packet,
        b"\xAA\x55",
    ]
    .concat();
    let mut cutter = dialect.cutter(Direction::ToDevice);
    let (mut passed, mut dropped) = (0, 0);
    for piece in stream.chunks(3) {
        cutter.push(piece, &mut |cut| match cut {
            Cut::Message(message) => {
                assert_eq!(message, packet);
                passed += 1;
            }
            Cut::Dropped(_) => dropped += 1,
        });
    }
    assert_eq!((passed, dropped), (2, 2));
    assert!(cutter.inside());
    cutter.reset();
    assert!(!cutter.inside());
}

#[test]
fn packets_without_a_checksum_are_in_step_after_garbage() {
    let dialect = Dialect::load("dlpc350").unwrap();
    let packet = dialect.request("arm", &[], 1).unwrap();
    assert_eq!(packet.len(), 64);
    for garbage in 0..200usize {
        let noise: Vec<u8> = (0..garbage).map(|i| 0xFF - (i % 5) as u8).collect();
        let stream = [&noise[..], &packet].concat();
        let passed = messages(&dialect, Direction::ToDevice, &stream, 64);
        assert!(
            passed == std::slice::from_ref(&packet),
            "{garbage} bytes of garbage"
        );
    }
    // A changed argument can be detected only by a checksum.
    let args = [("exposure", Value::Number(0.008))];
    let mut other = dialect.request("exposure", &args, 1).unwrap();
    other[6] ^= 1;
    let asked = dialect.asked(&other).unwrap();
    assert_eq!(asked.args[0].1, Value::Number(0.008001));
}

proptest! {
    #[test]
    fn messages_do_not_depend_on_how_input_is_split(
        bytes in proptest::collection::vec(
            prop_oneof![any::<u8>(), Just(b'\n'), Just(0xAA), Just(0x55), Just(0), Just(8)], 0..400),
        step in 1usize..60,
    ) {
        for dialect in DIALECTS.iter() {
            for direction in [Direction::ToDevice, Direction::ToHost] {
                let whole = messages(dialect, direction, &bytes, 400);
                prop_assert_eq!(&whole, &messages(dialect, direction, &bytes, step));
                for message in whole {
                    let _ = dialect.asked(&message);
                    for command in dialect.commands() {
                        let _ = dialect.reply(command, &message, 0);
                    }
                }
            }
        }
    }

    #[test]
    fn any_message_is_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..70)) {
        for dialect in DIALECTS.iter() {
            match dialect.asked(&bytes) {
                Ok(asked) => {
                    let _ = (dialect.runs(&asked), dialect.answer(&asked, &[]), dialect.busy(&asked));
                }
                Err(error) => { dialect.nack(&error); }
            }
        }
    }
}
