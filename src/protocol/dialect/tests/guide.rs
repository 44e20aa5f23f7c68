use super::super::{Dialect, Direction, Reply, Value};
use super::{messages, only};

/// Returns the dialect in the guide's example, copied from the guide as a reader would do.
fn example() -> Dialect {
    let guide = include_str!("../guide.md");
    let (_, rest) = guide.split_once("```toml dialect\n").unwrap();
    let (toml, _) = rest.split_once("```").unwrap();
    Dialect::parse(toml, "guide.md").unwrap()
}

#[test]
fn example_of_the_guide_works_as_described() {
    let gspark = example();
    let host = gspark.host().get("exposure").unwrap();
    let args = host.steps[0].args(&[("exposure", 0.008.into())]).unwrap();
    let bytes = gspark.request(&host.steps[0].command, &args, 0).unwrap();
    assert_eq!(bytes, b"M240 S8000\n");
    let line = only(&gspark, Direction::ToDevice, &bytes);
    let asked = gspark.asked(&line).unwrap();
    assert_eq!(gspark.runs(&asked), ["CAM:EXP 0.008"]);
    assert_eq!(gspark.answer(&asked, &[Vec::new()]).unwrap(), b"ok\r\n");
    let asked = gspark.asked(b"m241 ; how long?").unwrap();
    let reply = gspark.answer(&asked, &[b"0.008".to_vec()]).unwrap();
    assert_eq!(reply, b"S8000\r\nok\r\n");
    let lines = messages(&gspark, Direction::ToHost, &reply, 2);
    let values = vec![("exposure".to_owned(), Value::Number(0.008))];
    assert_eq!(gspark.reply("exposure?", &lines[0], 0), Reply::More(values));
    assert_eq!(
        gspark.reply("exposure?", &lines[1], 0),
        Reply::Done(Vec::new())
    );
    let error = gspark.asked(b"M240 S50").unwrap_err();
    assert_eq!(gspark.nack(&error), b"Error:4 out of range\r\n");
    let scan = gspark.asked(b"G38").unwrap();
    assert_eq!(gspark.runs(&scan), ["TRIG:SOUR BUS", "INIT;*TRG"]);
    // The argument is missing or lacks its S: the default error applies.
    for line in ["M240", "M240 8000", "M241 S1"] {
        let error = gspark.asked(line.as_bytes()).unwrap_err();
        assert_eq!(gspark.nack(&error), b"Error:1 failed\r\n", "{line}");
        assert_ne!(error.error.code.number(), -113, "{line}");
    }
    assert_eq!(gspark.host().needed().count(), 0);
}

/// The guide mentions every field of the dialect file.
#[test]
fn guide_mentions_every_field() {
    let guide = include_str!("../guide.md");
    let file = include_str!("../file.rs");
    for line in file.lines() {
        let Some(rest) = line.trim().strip_prefix("pub(super) ") else {
            continue;
        };
        let Some((name, _)) = rest.split_once(": ") else {
            continue;
        };
        let name = if name == "kind" { "type" } else { name };
        let mentioned = ["`NAME`", "`NAME ", "[NAME]", " NAME", "{ NAME", "`[[NAME]]"]
            .iter()
            .any(|form| guide.contains(&form.replace("NAME", name)));
        assert!(mentioned, "{name}");
    }
}
