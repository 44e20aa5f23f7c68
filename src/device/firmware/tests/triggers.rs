//! Times and contents of exposures.

use super::{MS, Port};
use crate::firmware::State;
use crate::{Exposure, PatternImage};

#[test]
fn one_trigger_runs_the_sequence_on_time() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR BUS;DEL 2ms;:INIT");
    assert_eq!(port.ask("STAT:OPER:COND?"), "32");
    port.at(100 * MS);
    assert_eq!(
        port.taken(),
        [],
        "an armed device exposes nothing before the trigger"
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
    assert_eq!(ids, expected, "ids continue");
}

#[test]
fn changes_that_would_break_a_run_are_refused() {
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
fn abort_ends_a_run_and_continuous_mode_rearms() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR BUS;:INIT:CONT ON");
    port.ask("INIT");
    assert_eq!(port.error(), -213);
    port.tell("*TRG");
    port.at(30 * MS);
    assert_eq!(port.taken().len(), 2);
    port.tell("ABOR");
    port.at(1000 * MS);
    assert_eq!(port.taken(), [], "an aborted exposure gives no frame");
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
    assert_eq!(port.error(), -211, "the device is not armed");
    port.tell("TRIG:SOUR BUS;:INIT");
    port.firmware.external_trigger(1000 * MS);
    port.at(2000 * MS);
    assert_eq!(port.taken(), []);
}

#[test]
fn free_run_exposes_only_while_streaming() {
    let mut port = Port::new();
    port.at(1000 * MS);
    assert_eq!(port.taken(), [], "nobody reads");
    assert_eq!(port.firmware.next_event_ns(), None, "no event is pending");
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
        "a long exposure lengthens the interval"
    );
    port.at(100_000 * MS);
    assert!(
        port.taken().len() <= 2 + 5,
        "frames are skipped after a long stall"
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
fn a_sequence_has_the_same_noise_however_long_the_camera_ran_free() {
    let noise_ids = |free_ms: u64| {
        let mut port = Port::new();
        port.firmware.set_streaming(true, 0);
        for ms in (0..=free_ms).step_by(100) {
            port.at(ms * MS);
        }
        port.tell("TRIG:SOUR BUS;:INIT;*TRG");
        port.at((free_ms + 1000) * MS);
        port.shots
            .iter()
            .map(|e| (e.shot.pattern_index, e.shot.noise_id))
            .partition::<Vec<_>, _>(|shot| shot.0.is_some())
    };
    let (sequence, free) = noise_ids(2000);
    assert_eq!(sequence, noise_ids(500).0);
    assert_eq!(sequence.len(), 13);
    assert!(free.len() > 50, "the camera runs free");
    let mut all: Vec<_> = sequence.iter().chain(&free).map(|shot| shot.1).collect();
    all.sort_unstable();
    all.dedup();
    assert_eq!(
        all.len(),
        sequence.len() + free.len(),
        "no noise id occurs twice"
    );
}

#[test]
fn shots_carry_the_current_settings() {
    let mut port = Port::new();
    port.tell("CAM:EXP 4ms;GAIN 3;ROI 8,8,16,16;:PROJ:CURR 0.25;:TRIG:SOUR BUS;:INIT;*TRG");
    port.at(1000 * MS);
    let Exposure { shot, readout } = &port.shots[11];
    assert_eq!(
        (shot.exposure_ns, shot.gain_db, shot.light),
        (4 * MS, 3.0, 0.25)
    );
    assert_eq!((readout.roi.x, readout.roi.width), (8, 16));
    assert_eq!(
        shot.pattern_image.as_deref(),
        Some(&PatternImage::Uniform(255))
    );
    port.shots.clear();
    port.tell("PROJ:POW OFF;:INIT;*TRG");
    port.at(2000 * MS);
    assert_eq!(port.shots[0].shot.pattern_image, None);
}

#[test]
fn same_triggers_give_the_same_shots() {
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
    // The result does not depend on the times to which the device is advanced in between.
    assert_eq!(run(&[]), run(&[77 * MS, 33 * MS, 1]));
    assert_eq!(run(&[]).len(), 39);
}

#[test]
fn the_truth_is_asked_about_the_exposures_that_were() {
    let mut port = Port::new();
    port.at(7 * MS);
    let starts = |port: &Port| -> Vec<u64> {
        let sequence = port.firmware.selected_sequence();
        sequence.iter().map(|(_, shot)| shot.start_ns).collect()
    };
    let period: u64 = (seconds(&port.ask("SEQ:PER?")) * 1e9).round() as u64;
    let count: u64 = port.ask("SEQ:COUN?").parse().unwrap();
    let from = |start: u64| (0..count).map(|i| start + i * period).collect::<Vec<_>>();
    assert_eq!(
        starts(&port),
        from(7 * MS),
        "without a run, times are as if triggered now"
    );
    port.tell("TRIG:SOUR BUS;:INIT");
    port.at(100 * MS);
    port.tell("*TRG");
    port.at(100 * MS + period);
    assert_eq!(
        starts(&port),
        from(100 * MS + period),
        "the second run is not complete"
    );
    port.at(100 * MS + count * period);
    port.at(90_000 * MS);
    assert_eq!(starts(&port), from(100 * MS));
    let name = port.ask("SEQ:SEL?");
    port.tell(&format!("SEQ:SEL {name}"));
    assert_eq!(starts(&port), from(90_000 * MS), "selected anew");
}

fn seconds(text: &str) -> f64 {
    text.parse().unwrap()
}
