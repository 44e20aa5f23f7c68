use super::super::command::Command;
use super::super::field::{Field, Kind};
use super::super::{Dialect, Direction, Reply, Value};
use super::{DIALECTS, messages, only};
use crate::scpi::{encode_block, parse, quote};
use proptest::prelude::*;

/// A seeded random number generator.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        let x = self.0 ^ self.0 >> 33;
        x.wrapping_mul(0xff51afd7ed558ccd) >> 8
    }

    fn below(&mut self, count: usize) -> usize {
        (self.roll() % count.max(1) as u64) as usize
    }
}

/// Returns a random valid value of a field, in the form in which it is decoded from the wire.
fn some(field: &Field, dice: &mut Dice, room: usize) -> Value {
    if let Some(constant) = &field.constant {
        return constant.clone();
    }
    if !field.choices.is_empty() {
        return Value::Text(field.choices[dice.below(field.choices.len())].1.clone());
    }
    let share = dice.roll() as f64 / (u64::MAX >> 8) as f64;
    let (low, high) = field.range;
    let number = low + (high - low) * share;
    match field.kind {
        Kind::F32 => Value::Number(f64::from((number as f32).clamp(low as f32, high as f32))),
        Kind::Float => Value::Number(number.clamp(low, high) / field.divisor),
        kind if kind.is_number() => Value::Number(number.round().clamp(low, high) / field.divisor),
        kind => {
            let len = dice.below(room.min(field.bytes.unwrap_or(room)) + 1);
            let bytes: Vec<u8> = (0..len).map(|_| dice.roll() as u8).collect();
            if kind.is_bytes() {
                return Value::Bytes(bytes);
            }
            let letters = b"abcXYZ019-_.";
            let letter = |b: &u8| char::from(letters[usize::from(*b) % letters.len()]);
            let text: String = bytes.iter().map(letter).collect();
            Value::Text(match kind {
                // SCPI character data has at most twelve characters.
                Kind::Word => {
                    let letters = text.chars().filter(char::is_ascii_alphanumeric);
                    std::iter::once('w').chain(letters).take(12).collect()
                }
                _ if text.is_empty() => "t".to_owned(),
                _ => text,
            })
        }
    }
}

fn all(fields: &[Field], dice: &mut Dice, room: usize) -> Vec<(String, Value)> {
    let one = |field: &Field| (field.name.clone(), some(field, dice, room));
    fields.iter().map(one).collect()
}

/// Returns answers of the firmware that give these values.
fn answers(command: &Command, values: &[(String, Value)]) -> Vec<Vec<u8>> {
    let raw = |name: &str| {
        let field = command.value(name).unwrap();
        let (_, value) = values.iter().find(|(n, _)| n == name).unwrap();
        Ok::<_, String>(match value {
            Value::Number(number) => number.to_string().into_bytes(),
            Value::Text(word) if !field.choices.is_empty() => word.clone().into_bytes(),
            Value::Text(text) if command.values.len() == 1 => quote(text).into_bytes(),
            Value::Text(text) => text.clone().into_bytes(),
            Value::Bytes(bytes) => encode_block(bytes),
        })
    };
    let answer = |template: &Option<super::super::template::Template>| match template {
        Some(template) => template.fill(raw).unwrap(),
        None => Vec::new(),
    };
    command.answers.iter().map(answer).collect()
}

/// Checks that random arguments of a command and random values of its reply arrive unchanged.
fn goes_round(dialect: &Dialect, command: &Command, seed: u64) {
    let name = &command.name;
    let dice = &mut Dice(seed);
    let args = all(&command.args, dice, 12);
    let given: Vec<(&str, Value)> = args.iter().map(|(n, v)| (n.as_str(), v.clone())).collect();
    let sequence = seed as u8;
    let bytes = dialect.request(name, &given, sequence).unwrap();
    let message = only(dialect, Direction::ToDevice, &bytes);
    if dialect.is_scpi() {
        assert_eq!(parse(&message).error, None, "{name}");
        return;
    }
    let asked = dialect.asked(&message).unwrap();
    assert_eq!(&asked.command, name);
    assert_eq!(asked.args, args, "{name}");
    assert!(asked.wants_reply);
    for run in dialect.runs(&asked) {
        let program = parse(run.as_bytes());
        assert_eq!(program.error, None, "{run}");
        assert!(!program.units.is_empty(), "{run}");
    }
    if command.chunk.is_some() {
        return;
    }
    let values = all(&command.values, dice, 12);
    let bytes = dialect.answer(&asked, &answers(command, &values)).unwrap();
    let mut got = Vec::new();
    let replies = messages(dialect, Direction::ToHost, &bytes, 5);
    for (at, reply) in replies.iter().enumerate() {
        match dialect.reply(name, reply, asked.sequence) {
            Reply::More(values) if at + 1 < replies.len() => got.extend(values),
            Reply::Done(values) if at + 1 == replies.len() => got.extend(values),
            other => panic!("{name}: {other:?}"),
        }
        if dialect.has_sequence() {
            let late = dialect.reply(name, reply, sequence.wrapping_add(1));
            assert_eq!(late, Reply::Other);
        }
    }
    assert_eq!(got, values, "{name}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_command_of_every_dialect_is_read_as_written(seed: u64) {
        for dialect in DIALECTS.iter() {
            for (at, command) in dialect.commands.iter().enumerate() {
                goes_round(dialect, command, seed.wrapping_add(at as u64));
            }
        }
    }
}

/// A host decodes the native answers of the SCPI device.
#[test]
fn scpi_answers_are_read() {
    let scpi = Dialect::load("scpi").unwrap();
    let done = |command: &str, line: &[u8]| match scpi.reply(command, line, 0) {
        Reply::Done(values) => values
            .into_iter()
            .map(|(_, value)| value)
            .collect::<Vec<_>>(),
        other => panic!("{command}: {other:?}"),
    };
    assert_eq!(
        done("list?", b"\"a\",\"b c\""),
        [Value::from("\"a\",\"b c\"")]
    );
    assert_eq!(done("selected?", b"\"a\"\"b\""), [Value::from("a\"b")]);
    assert_eq!(
        done("manifest?", b"#15a\nb\"#"),
        [Value::Bytes(b"a\nb\"#".to_vec())]
    );
    assert_eq!(
        done("error?", b"-222,\"Data out of range;9, allowed 0 to 1\""),
        [
            Value::from(-222.0),
            Value::from("Data out of range;9, allowed 0 to 1")
        ]
    );
    assert_eq!(done("complete?", b"1"), []);
    assert_eq!(done("identity?", b"a,b,c,d e").len(), 4);
    let bytes = scpi
        .request("select", &[("name", "a\"b".into())], 0)
        .unwrap();
    assert_eq!(bytes, b"SEQ:SEL \"a\"\"b\"\n");
}
