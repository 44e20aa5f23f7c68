use super::*;

fn parse(text: &str) -> Result<Schedule> {
    Schedule::from_source(&TomlSource::new(text, "bad-day.toml"))
}

#[test]
fn kinds_parse_by_their_names_and_are_written_without_their_defaults() {
    for kind in Kind::ALL {
        let schedule = parse(&format!("[[fault]]\nwhat = {:?}", kind.name)).unwrap();
        assert_eq!(schedule.fault, [Fault::new(kind.what)]);
        assert_eq!(schedule.fault[0].side(), kind.sides[0]);
        let json = serde_json::to_string(&schedule.fault[0]).unwrap();
        assert_eq!(json, format!("{{\"what\":{:?}}}", kind.name));
    }
    let fault = Fault::once(What::Late { by_ms: 20.0 }, 3);
    let json = serde_json::to_string(&fault).unwrap();
    let words = r#"{"what":"late","by_ms":20.0,"when":{"nth":3},"times":1}"#;
    assert_eq!(json, words);
    assert_eq!(serde_json::from_str::<Fault>(words).unwrap(), fault);
}

#[test]
fn schedule_is_read_with_faults_and_conditions() {
    let schedule = parse(
        "seed = 7\n[[fault]]\nwhat = \"bit-errors\"\ndirection = \"to-device\"\nrate = 1e-3\n\
         when = { command = \"seq:\", probability = 0.5, window_s = [1, 2.5] }\ntimes = 3\n\
         [[fault]]\nwhat = \"reset\"\nwhen = { nth = 40, every = 2, frames = \"all\" }\n",
    )
    .unwrap();
    assert_eq!(schedule.seed, 7);
    let [first, second] = &schedule.fault[..] else {
        panic!("two");
    };
    let wanted = What::BitErrors {
        direction: Direction::ToDevice,
        count: None,
        rate: Some(1e-3),
    };
    assert_eq!(first.what, wanted);
    assert_eq!((first.times, first.side()), (Some(3), Side::Port));
    assert_eq!(first.when.window_s, Some([1.0, 2.5]));
    assert_eq!(second.side(), Side::Camera);
    assert_eq!((second.when.nth, second.when.every), (Some(40), Some(2)));
}

#[test]
fn a_fault_for_a_device_that_is_not_there_is_refused_with_its_line() {
    let source = TomlSource::new(
        "[[fault]]\nwhat = \"dark\"\n[[fault]]\nwhat = \"dark\"\ndevice = \"right\"\n",
        "bad-day.toml",
    );
    let schedule = Schedule::from_source(&source).unwrap();
    check_devices(&schedule, &["left", "right"], &source).unwrap();
    let refused = check_devices(&schedule, &["left", "middle"], &source);
    let words = "bad-day.toml:5: fault[1].device: \"right\"; expected left, middle";
    assert_eq!(refused.unwrap_err().to_string(), words);
}

#[test]
fn invalid_schedule_is_refused_with_its_line() {
    for (fields, complaint) in [
        (
            "what = \"torm\"",
            "bad-day.toml:3: fault[0].what: \"torm\"; expected dropped, repeated",
        ),
        (
            "what = \"dark\"\nby_ms = 3",
            "bad-day.toml:4: fault[0].by_ms: not a parameter of dark; expected none",
        ),
        (
            "what = \"torn\"\nrows = 3",
            "bad-day.toml:4: fault[0].rows: not a parameter of torn; expected row",
        ),
        (
            "what = \"torn\"\nrow = 0",
            "bad-day.toml:4: fault[0].row: 0; expected 1 to 65535",
        ),
        (
            "what = \"late\"\nby_ms = -1",
            "bad-day.toml:4: fault[0].by_ms: -1; expected 0 to 3600000 ms",
        ),
        (
            "what = \"late\"\non = \"port\"",
            "bad-day.toml:4: fault[0].on: port for late; expected camera",
        ),
        (
            "what = \"nak\"\nwhen = { frames = \"all\" }",
            "bad-day.toml:4: fault[0].when.frames: nak counts messages; expected only for faults",
        ),
        (
            "what = \"nak\"\nwhen = { nth = 0 }",
            "bad-day.toml:4: fault[0].when.nth: 0; expected 1 to 18446744073709551615",
        ),
        (
            "what = \"nak\"\nwhen = { window_s = [2, 1] }",
            "bad-day.toml:4: fault[0].when.window_s: 2 to 1; expected two ascending times",
        ),
        (
            "what = \"nak\"\nwhen = { probability = nan }",
            "bad-day.toml:4: fault[0].when.probability: NaN; expected 0.0 to 1.0",
        ),
        (
            "what = \"bit-errors\"\ncount = 1\nrate = 0.1",
            "bad-day.toml:5: fault[0].rate: a rate and a count; expected only one of them",
        ),
        (
            "what = \"wrong-pattern\"\noffset = 0",
            "bad-day.toml:4: fault[0].offset: 0; expected any number but 0",
        ),
        (
            "what = \"late\"\nby_ms = \"soon\"",
            "bad-day.toml:4: fault[0].by_ms: \"soon\"; expected 0 to 3600000 ms",
        ),
        (
            "what = \"late\"\nby_ms = nan",
            "bad-day.toml:4: fault[0].by_ms: NaN; expected 0 to 3600000 ms",
        ),
        (
            "what = \"torn\"\ntiems = 1",
            "bad-day.toml:4: fault[0].tiems: not a parameter of torn; expected row",
        ),
        (
            "times = 1",
            "bad-day.toml:2: fault[0].what: missing; expected dropped",
        ),
    ] {
        let error = parse(&format!("seed = 1\n[[fault]]\n{fields}\n"));
        let error = error.unwrap_err().to_string();
        assert!(error.starts_with(complaint), "{error}");
    }
    let many = "[[fault]]\nwhat = \"dark\"\n".repeat(MAX_FAULTS + 1);
    let error = parse(&many).unwrap_err().to_string();
    assert!(
        error.contains("1025 faults; expected up to 1024"),
        "{error}"
    );
}
