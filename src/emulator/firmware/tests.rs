//! The firmware in virtual time, as a client of the control port sees it.

use super::*;
use crate::profile::Profile;
use proptest::prelude::*;

const MS: u64 = 1_000_000;

/// A device whose clock the test sets by hand; frames leave it at once.
struct Port {
    firmware: Firmware,
    now_ns: u64,
    shots: Vec<Exposure>,
}

impl Port {
    fn new() -> Self {
        let profile = Profile::load("webcam-grey").unwrap();
        Self {
            firmware: Firmware::new(&profile, &[]).unwrap(),
            now_ns: 0,
            shots: Vec::new(),
        }
    }

    fn bytes(&mut self, bytes: &[u8]) -> String {
        self.firmware.receive(bytes, self.now_ns);
        self.collect();
        String::from_utf8(self.firmware.take_output()).unwrap()
    }

    fn ask(&mut self, line: &str) -> String {
        let reply = self.bytes(format!("{line}\n").as_bytes());
        reply.trim_end().to_owned()
    }

    /// Sends a line that has no answer and no error.
    fn tell(&mut self, line: &str) {
        assert_eq!(self.ask(line), "", "{line}");
        assert_eq!(self.error(), 0, "{line}");
    }

    fn error(&mut self) -> i32 {
        let reply = self.ask("SYST:ERR?");
        reply.split_once(',').unwrap().0.parse().unwrap()
    }

    fn at(&mut self, ns: u64) -> String {
        self.now_ns = ns;
        self.firmware.advance(ns);
        self.collect();
        String::from_utf8(self.firmware.take_output()).unwrap()
    }

    fn collect(&mut self) {
        let new = self.firmware.take_exposures();
        self.firmware.delivered(new.len() as u64);
        self.shots.extend(new);
    }

    /// Id, pattern and start of each shot since the last call.
    fn taken(&mut self) -> Vec<(u64, Option<u32>, u64)> {
        self.shots
            .drain(..)
            .map(|e| (e.shot.id, e.shot.pattern_index, e.shot.start_ns))
            .collect()
    }
}

#[test]
fn queries_answer_and_settings_stick() {
    let mut port = Port::new();
    for (order, query, answer) in [
        ("", "*IDN?", "Phasma,webcam-grey,0001,0.1.0"),
        ("", "SYSTEM:VERSION?", "1999.0"),
        ("", "*TST?", "0"),
        ("CAM:EXP 5ms", "CAMERA:EXPOSURE?", "0.005"),
        ("CAM:EXP 50 us", "CAM:EXP?", "0.00005"),
        ("CAM:EXP DEF", "CAM:EXP?", "0.012"),
        ("", "CAM:EXP? MAX;EXP? MIN", "0.5;0.00005"),
        ("CAM:GAIN 6.5 dB", "CAM:GAIN?", "6.5"),
        ("CAM:FORM GREY", "CAM:FORM?", "GREY"),
        ("CAM:ROI 10,20,30,40", "CAM:ROI?", "10,20,30,40"),
        ("CAM:ROI MIN,MIN,MAX,MAX", "CAM:ROI?", "0,0,640,480"),
        ("CAM:INT 40 ms", "CAM:INT?", "0.04"),
        ("PROJ:POW OFF", "PROJ:POW?", "0"),
        ("PROJ:CURR 50 PCT", "PROJ:CURR?", "0.5"),
        ("PROJ:PATT 3", "PROJ:PATT?", "3"),
        ("PROJ:PATT black", "PROJ:PATT?", "BLAC"),
        ("SEQ:SEL 'quick-4'", "SEQ:SEL?", "\"quick-4\""),
        ("", "SEQ:LIST?", "\"quick-4\""),
        ("", "SEQ:COUN?", "13"),
        ("SEQ:PER 20ms", "SEQ:PER?", "0.02"),
        ("TRIG:SOUR SOFTWARE", "TRIG:SOUR?", "SOFT"),
        ("TRIG:DEL 1ms", "TRIG:DEL?", "0.001"),
        ("TRIG:MODE STEP", "TRIG:MODE?", "STEP"),
        ("INIT:CONT ON", "INIT:CONT?", "1"),
        ("*ESE 36", "*ESE?", "36"),
        ("*SRE 255", "*SRE?", "191"),
        ("STAT:OPER:ENAB 48", "STAT:OPER:ENAB?", "48"),
        ("STAT:QUES:ENAB #HFFFF", "STAT:QUES:ENAB?", "32767"),
        ("STAT:PRES", "STAT:OPER:ENAB?;:STAT:QUES:ENAB?", "0;0"),
        ("", "DIAG:FRAM?", "0"),
        (
            "*RST",
            "PROJ:POW?;PATT?;:TRIG:SOUR?;:INIT:CONT?",
            "1;WHIT;INT;0",
        ),
    ] {
        port.tell(order);
        assert_eq!(port.ask(query), answer, "{order} {query}");
    }
}

#[test]
fn mistakes_have_the_standard_s_numbers() {
    let mut port = Port::new();
    for (line, code) in [
        ("FOO:BAR", -113),
        ("CAM:EXP 1", -222),
        ("CAM:EXP -1ms", -222),
        ("CAM:EXP 17ms", -221), // above the sequence's period of 16 ms
        ("SEQ:PER 1ms", -221),
        ("CAM:EXP", -109),
        ("CAM:EXP 1,2", -108),
        ("CAM:EXP? 3", -108),
        ("CAM:EXP 5 V", -131),
        ("CAM:EXP FAST", -141),
        ("CAM:EXP 'x'", -158),
        ("CAM:EXP #11x", -168),
        ("CAM:FORM MJPG", -224),
        ("CAM:ROI 0,0,641,1", -222),
        ("CAM:ROI 639,0,2,1", -222),
        ("CAM:ROI 0,0", -109),
        ("CAM:GAIN 18.1", -222),
        ("CAM2:GAIN 1", -114),
        ("PROJ:CURR 1.5", -222),
        ("PROJ:PATT 13", -222),
        ("PROJ:PATT GREEN", -224),
        ("PROJ:POW MAYBE", -141),
        ("SEQ:SEL \"moon\"", -256),
        ("SEQ:SEL moon", -148),
        ("SEQ:DEL 'quick-4'", -221),
        ("TRIG:SOUR MOON", -224),
        ("*TRG", -211),
        ("TRIG", -211),
        ("INIT", -221), // the camera runs free
        ("TRIG:SOUR BUS;:INIT;INIT", -213),
        ("*IDN", -113),
        ("*RST?", -113),
        ("*CLS 1", -108),
        ("SYST:ERR? 1", -108),
        ("*ESE 256", -222),
        ("CAM:EXP 1;;@", -222),
    ] {
        assert_eq!(port.ask(line), "", "{line}");
        assert_eq!(port.error(), code, "{line}");
        port.ask("ABOR;*CLS");
    }
    assert_eq!(port.ask("FOO"), "");
    assert_eq!(
        port.ask("SYST:ERR:COUN?;NEXT?"),
        "1;-113,\"Undefined header;FOO\""
    );
    assert_eq!(port.ask("SYST:ERR?"), "0,\"No error\"");
}

#[test]
fn an_unknown_header_voids_the_rest_and_a_bad_value_does_not() {
    let mut port = Port::new();
    assert_eq!(port.ask("*TST?;FOO;*TST?"), "0");
    assert_eq!(port.ask("*TST?;CAM:GAIN 99;*TST?"), "0;0");
    assert_eq!((port.error(), port.error(), port.error()), (-113, -222, 0));
}

#[test]
fn one_trigger_runs_the_sequence_on_time() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR BUS;DEL 2ms;:INIT");
    assert_eq!(port.ask("STAT:OPER:COND?"), "32");
    port.at(100 * MS);
    assert_eq!(
        port.taken(),
        [],
        "armed, nothing is exposed before the trigger"
    );
    port.tell("*TRG");
    assert_eq!(port.ask("STAT:OPER:COND?"), "16");
    assert_eq!(port.firmware.next_event_ns(), Some(114 * MS));
    port.at(114 * MS - 1);
    assert_eq!(port.taken(), []);
    port.at(114 * MS);
    assert_eq!(port.taken(), [(0, Some(0), 102 * MS)]);
    port.at(5000 * MS);
    let rest: Vec<_> = (1..13)
        .map(|i| (i, Some(i as u32), (102 + 16 * i) * MS))
        .collect();
    assert_eq!(port.taken(), rest);
    assert_eq!(port.ask("STAT:OPER:COND?;EVEN?;:DIAG:FRAM?"), "0;48;13");
    port.tell("INIT;*TRG");
    port.at(6000 * MS);
    let ids: Vec<_> = port.taken().iter().map(|s| (s.0, s.1)).collect();
    let expected: Vec<_> = (0..13).map(|i| (13 + u64::from(i), Some(i))).collect();
    assert_eq!(ids, expected, "ids go on");
}

#[test]
fn what_would_break_a_run_is_refused_during_it() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR BUS;:INIT;*TRG");
    port.at(20 * MS);
    for (line, code) in [
        ("CAM:EXP 1ms", -221),
        ("CAM:ROI 0,0,8,8", -221),
        ("PROJ:POW OFF", -221),
        ("SEQ:PER 1", -221),
        ("SEQ:SEL 'quick-4'", -221),
        ("TRIG:SOUR INT", -221),
        ("TRIG:MODE STEP", -221),
        ("INIT", -213),
        ("*TRG", -211),
    ] {
        assert_eq!(port.ask(line), "", "{line}");
        assert_eq!(port.error(), code, "{line}");
    }
    port.at(1000 * MS);
    assert_eq!(port.taken().len(), 13);
}

#[test]
fn step_mode_takes_a_trigger_a_pattern() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR SOFT;MODE STEP;:INIT");
    for i in 0..13u64 {
        port.tell("TRIG:IMM");
        assert_eq!(port.ask("TRIG"), "");
        assert_eq!(port.error(), -211, "too soon");
        port.at((i + 1) * 100 * MS);
        assert_eq!(port.taken(), [(i, Some(i as u32), i * 100 * MS)]);
    }
    assert_eq!(port.firmware.state(), State::Idle);
    port.ask("TRIG");
    assert_eq!(port.error(), -211, "done");
}

#[test]
fn abort_ends_a_run_and_continuous_arms_again() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR BUS;:INIT:CONT ON");
    port.ask("INIT");
    assert_eq!(port.error(), -213);
    port.tell("*TRG");
    port.at(30 * MS);
    assert_eq!(port.taken().len(), 2);
    port.tell("ABOR");
    port.at(1000 * MS);
    assert_eq!(port.taken(), [], "an exposure cut short gives no frame");
    assert_eq!(port.firmware.state(), State::Armed { next: 0 });
    port.tell("*TRG");
    port.at(2000 * MS);
    assert_eq!(port.taken().len(), 13);
    assert_eq!(port.firmware.state(), State::Armed { next: 0 });
    port.tell("INIT:CONT OFF;:ABOR");
    assert_eq!(port.firmware.state(), State::Idle);
}

#[test]
fn only_the_source_that_is_set_triggers() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR EXT;:INIT");
    port.ask("*TRG");
    assert_eq!(port.error(), -211);
    port.firmware.external_trigger(0);
    port.at(1000 * MS);
    assert_eq!(port.taken().len(), 13);
    port.firmware.external_trigger(1000 * MS);
    assert_eq!(port.error(), -211, "recognised, but not armed");
    port.tell("TRIG:SOUR BUS;:INIT");
    port.firmware.external_trigger(1000 * MS);
    port.at(2000 * MS);
    assert_eq!(port.taken(), []);
}

#[test]
fn runs_free_for_those_who_read() {
    let mut port = Port::new();
    port.at(1000 * MS);
    assert_eq!(port.taken(), [], "nobody reads");
    assert_eq!(
        port.firmware.next_event_ns(),
        None,
        "and nothing wakes the device"
    );
    port.firmware.set_streaming(true, port.now_ns);
    port.tell("CAM:INT 50ms;:PROJ:PATT 2");
    port.at(1200 * MS);
    assert_eq!(
        port.taken(),
        [1000, 1050, 1100, 1150].map(|ms| ((ms - 1000) / 50, None, ms * MS))
    );
    port.tell("SEQ:PER 1;:CAM:EXP 200ms");
    port.at(1900 * MS);
    let starts: Vec<_> = port.taken().iter().map(|s| s.2 / MS).collect();
    assert_eq!(
        starts,
        [1200, 1400, 1600],
        "an exposure stretches the interval"
    );
    port.at(100_000 * MS);
    assert!(
        port.taken().len() <= 2 + 5,
        "no catching up after a long stall"
    );
    port.tell("TRIG:SOUR BUS");
    port.at(101_000 * MS);
    assert_eq!(port.taken(), []);
    port.firmware.set_streaming(false, port.now_ns);
    port.tell("TRIG:SOUR INT");
    port.at(102_000 * MS);
    assert_eq!(port.taken(), []);
}

#[test]
fn opc_waits_for_the_last_frame() {
    let mut port = Port::new();
    assert_eq!(port.ask("*OPC?"), "1");
    assert_eq!(port.ask("TRIG:SOUR BUS;:INIT;*TRG;*OPC?;*IDN?"), "");
    assert_eq!(port.ask("*TST?"), "", "behind the waiting *OPC?");
    assert_eq!(port.at(203 * MS), "");
    assert_eq!(port.at(204 * MS), "1;Phasma,webcam-grey,0001,0.1.0\n0\n");
    port.ask("*CLS");
    port.tell("INIT;*OPC;*TRG");
    assert_eq!(port.ask("*ESR?"), "0");
    port.at(1000 * MS);
    assert_eq!(port.ask("*ESR?"), "1");
    assert_eq!(port.ask("INIT;*WAI;*TST?"), "");
    assert_eq!(port.ask("*TRG"), "", "a trigger acts at once");
    assert_eq!(port.at(2000 * MS), "0\n");
    assert_eq!(port.ask("INIT;*OPC?"), "");
    assert_eq!(port.ask("ABOR"), "1", "and so does ABORt");
    assert_eq!(port.ask("INIT;*OPC?"), "");
    for _ in 0..100 {
        port.ask("*TST?");
    }
    port.firmware.hang_up();
    assert_eq!(port.error(), -363, "what waits is bounded");
    assert_eq!(port.ask("*TST?"), "0", "and goes with the cable");
}

#[test]
fn frames_in_flight_hold_up_completion() {
    let mut port = Port::new();
    port.firmware
        .receive(b"TRIG:SOUR BUS;:INIT;*TRG;*OPC?\n", 0);
    port.firmware.advance(1000 * MS);
    assert_eq!(port.firmware.take_exposures().len(), 13);
    assert_eq!(port.firmware.take_output(), b"");
    port.firmware.delivered(12);
    assert_eq!(port.firmware.take_output(), b"");
    port.firmware.delivered(1);
    assert_eq!(port.firmware.take_output(), b"1\n");
}

#[test]
fn calibration_and_manifest_come_as_blocks_that_read_back() {
    let mut port = Port::new();
    let profile = Profile::load("webcam-grey").unwrap();
    let block = |reply: String| {
        let (content, rest) = crate::protocol::scpi::split_block(reply.as_bytes()).unwrap();
        assert_eq!(rest, b"\n");
        String::from_utf8(content.to_vec()).unwrap()
    };
    let manifest = crate::pattern::Manifest::parse(&block(port.bytes(b"SEQ:DATA?\n")), "").unwrap();
    assert_eq!(manifest, profile.manifest(&profile.sequence[0]));
    let rig = |text: String| crate::geometry::Rig::from_toml(&text, "").unwrap();
    assert_eq!(
        rig(block(port.bytes(b"CAL:DATA?\n"))),
        profile.nominal_rig()
    );
    port.tell("CAM:ROI 100,50,200,100;GAIN 6");
    let cropped = rig(block(port.bytes(b"CAL:DATA?\n")));
    let (a, b) = (cropped.camera.lens, profile.nominal_rig().camera.lens);
    assert_eq!((a.width_px, a.height_px), (200, 100));
    assert_eq!(
        b.principal_px - a.principal_px,
        glam::DVec2::new(100.0, 50.0)
    );
    assert_eq!(cropped.noise, Some(profile.camera.sensor.noise_model(6.0)));
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let image = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x + y) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn with_block(order: &str, content: &[u8]) -> Vec<u8> {
    let mut line = order.as_bytes().to_vec();
    line.extend(crate::protocol::scpi::encode_block(content));
    line.push(b'\n');
    line
}

#[test]
fn a_sequence_of_the_user_s_own_comes_over_the_port() {
    const HEAD: &str = "[projector]\nwidth_px = 854\nheight_px = 480\n";
    let mut port = Port::new();
    let own = format!(
        "{HEAD}[[frame]]\npattern = {{ kind = \"image\", file = \"dots.png\" }}\n\
         [[frame]]\npattern = {{ kind = \"white\" }}\n"
    );
    let define = |toml: &str| with_block("SEQ:DEF 'own',", toml.as_bytes());
    for (bytes, code) in [
        (define(&own), -256),
        (with_block("SEQ:IMAG 'dots.png',", b"no picture"), -224),
        (with_block("SEQ:IMAG 'dots.png',", &png(853, 480)), -224),
        (with_block("SEQ:IMAG 'dots.png',", &png(854, 480)), 0),
        (define("[projector"), -200),
        (define(&own.replace("854", "855")), -200),
        (with_block("SEQ:DEF 'quick-4',", own.as_bytes()), -224),
        (with_block("SEQ:DEF 'no/name',", own.as_bytes()), -224),
        (define(&own), 0),
        (b"SEQ:SEL 'own'\n".to_vec(), 0),
        (define(&own), 0),
        (b"SEQ:DEL 'own'\n".to_vec(), -221),
    ] {
        assert_eq!(port.bytes(&bytes), "");
        assert_eq!(
            port.error(),
            code,
            "{}",
            bytes[..40.min(bytes.len())].escape_ascii()
        );
    }
    assert_eq!(
        port.ask("SEQ:LIST?;COUN?;SEL?"),
        "\"quick-4\",\"own\";2;\"own\""
    );
    port.tell("TRIG:SOUR BUS;:INIT;*TRG");
    port.at(1000 * MS);
    let Some(Slide::Picture { levels, .. }) = port.shots[0].shot.slide.as_deref() else {
        panic!("{:?}", port.shots)
    };
    assert_eq!(levels[854 + 3], 4, "row 1, column 3");
    port.tell("SEQ:SEL 'quick-4';DEL 'own';IMAG:DEL 'dots.png'");
    assert_eq!(port.ask("SEQ:LIST?"), "\"quick-4\"");
}

#[test]
fn a_bad_manifest_says_why() {
    let mut port = Port::new();
    port.bytes(&with_block(
        "SEQ:DEF 'own',",
        b"[projector]\nwidth_px = -3\nheight_px = 1\n",
    ));
    let text = port.ask("SYST:ERR?");
    assert!(text.starts_with("-200,\"Execution error;own:2"), "{text}");
}

#[test]
fn shots_carry_what_was_set() {
    let mut port = Port::new();
    port.tell("CAM:EXP 4ms;GAIN 3;ROI 8,8,16,16;:PROJ:CURR 0.25;:TRIG:SOUR BUS;:INIT;*TRG");
    port.at(1000 * MS);
    let Exposure { shot, roi } = &port.shots[11];
    assert_eq!(
        (shot.exposure_ns, shot.gain_db, shot.light),
        (4 * MS, 3.0, 0.25)
    );
    assert_eq!((roi.x, roi.width), (8, 16));
    assert_eq!(shot.slide.as_deref(), Some(&Slide::Uniform(255)));
    port.shots.clear();
    port.tell("PROJ:POW OFF;:INIT;*TRG");
    port.at(2000 * MS);
    assert_eq!(port.shots[0].shot.slide, None);
}

#[test]
fn a_stalled_block_is_given_up() {
    let mut port = Port::new();
    port.bytes(b"SEQ:IMAG 'x',#6100000abc\n*IDN?\n");
    assert!(port.firmware.inside_block());
    port.firmware.input_stalled();
    assert_eq!(port.ask("*TST?"), "0");
    assert_eq!(port.error(), -161);
}

#[test]
fn same_triggers_same_shots() {
    let run = |steps: &[u64]| {
        let mut port = Port::new();
        port.tell("CAM:GAIN 1;:TRIG:SOUR BUS;:INIT:CONT ON");
        for at in [0, 400 * MS, 900 * MS] {
            for &step in steps {
                port.at(at.saturating_sub(step));
            }
            port.at(at);
            port.tell("*TRG");
        }
        port.at(2000 * MS);
        port.shots
    };
    // How often the device is looked at in between does not matter.
    assert_eq!(run(&[]), run(&[77 * MS, 33 * MS, 1]));
    assert_eq!(run(&[]).len(), 39);
}

proptest! {
    /// Whatever comes, the device survives, its queue drains, and it then answers.
    #[test]
    fn survives_any_bytes(chunks in proptest::collection::vec(
        prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..40),
            prop_oneof![
                Just("*RST\n"), Just("TRIG:SOUR BUS;:INIT;*TRG\n"), Just("*OPC?;*WAI\n"),
                Just("CAM:ROI 1,2,3,"), Just("INIT:CONT ON\n"), Just("ABOR\n"), Just(";*IDN?"),
                Just("PROJ:PATT 3\n"), Just("SEQ:DEF 'a',#13abc\n"),
            ].prop_map(|s: &str| s.as_bytes().to_vec()),
        ], 0..20))
    {
        let mut port = Port::new();
        port.firmware.set_streaming(true, 0);
        for (i, chunk) in chunks.iter().enumerate() {
            port.firmware.receive(chunk, i as u64 * 50 * MS);
            port.now_ns = i as u64 * 50 * MS;
            port.collect();
            port.firmware.take_output();
        }
        let ids: Vec<_> = port.shots.iter().map(|e| e.shot.id).collect();
        prop_assert!(ids.iter().copied().eq(0..ids.len() as u64), "ids in order, none twice");
        port.firmware.hang_up();
        port.ask("*CLS");
        prop_assert_eq!(port.ask("*TST?"), "0");
    }
}

/// The first cells of a document's tables, without their backticks.
fn documented() -> Vec<&'static str> {
    let rows = include_str!("commands.md").lines();
    rows.filter_map(|line| line.strip_prefix("| `")?.split_once("` |"))
        .map(|(cell, _)| cell)
        .collect()
}

/// Each command has one row, which says whether it can be ordered, asked, or both.
#[test]
fn the_documentation_has_every_command_and_no_other() {
    let firmware = Port::new().firmware;
    let takes = |text: &str| {
        let program = crate::protocol::scpi::parse(text.as_bytes());
        let unit = &program.units[0];
        let command = table::find(unit).unwrap();
        firmware.check_form(unit, command).is_ok()
    };
    let mut expected: Vec<String> = table::TABLE
        .iter()
        .map(|(pattern, _)| {
            let header = pattern.replace(['[', ']'], "");
            match (takes(&header), takes(&format!("{header}?"))) {
                (true, true) => format!("{pattern}(?)"),
                (true, false) => (*pattern).to_owned(),
                (false, asked) => {
                    assert!(asked, "{pattern}");
                    format!("{pattern}?")
                }
            }
        })
        .collect();
    let mut found = documented();
    expected.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, expected);
}

/// The table's fixed values after `*RST`, and bounds that no profile decides.
#[test]
fn the_documentation_s_values_are_the_device_s() {
    let mut port = Port::new();
    port.tell("*RST");
    for (query, answer) in [
        ("CAM:GAIN?;GAIN? MIN", "0;0"),
        ("CAM:INT? MIN;INT? MAX", "0.0001;60"),
        ("PROJ:POW?;CURR?;PATT?", "1;1;WHIT"),
        ("SEQ:PER? MAX", "60"),
        ("TRIG:SOUR?;MODE?;DEL?;DEL? MAX", "INT;SEQ;0;60"),
        ("INIT:CONT?", "0"),
        ("SYST:VERS?", "1999.0"),
    ] {
        assert_eq!(port.ask(query), answer, "{query}");
    }
}
