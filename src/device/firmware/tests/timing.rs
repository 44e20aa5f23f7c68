//! A projector with timing: allowed settings, the times at which patterns are shown, and triggers
//! that come too early.

use super::{MS, Port};
use crate::firmware::State;
use crate::{PatternImage, Shot};
use phasmid_profile::{Profile, Timing};

const US: u64 = 1000;

fn profile(change: impl FnOnce(&mut Timing)) -> Profile {
    let mut profile = Profile::load("dlp-evm").unwrap();
    if let Some(timing) = &mut profile.projector.timing {
        change(timing);
    }
    profile
}

fn port(change: impl FnOnce(&mut Timing)) -> Port {
    Port::of(&profile(change))
}

/// Adds dark time before and after each pattern, as with a DLPC3478.
fn dark(timing: &mut Timing) {
    timing.dark_before_us = 171.0;
    timing.dark_after_us = 31.0;
}

#[test]
fn times_are_quantised_and_answered_so() {
    let mut port = port(|timing| timing.resolution_us = 1.0);
    for (order, query, answer) in [
        ("*RST", "PROJ:EXP?", "0.0085"),
        (
            "*RST",
            "PROJ:EXP? MIN;EXP? MAX;EXP? DEF",
            "0.008333;0.01;0.0085",
        ),
        ("PROJ:EXP 9000.4us", "PROJ:EXP?", "0.009"),
        ("PROJ:EXP 9000.5us", "PROJ:EXP?", "0.009001"),
        ("PROJ:EXP 9769.51us", "PROJ:EXP?", "0.00977"),
        ("PROJ:EXP MIN", "PROJ:EXP?", "0.008333"),
        ("PROJ:EXP MAX", "PROJ:EXP?", "0.01"),
        ("PROJ:EXP DEF", "PROJ:EXP?", "0.0085"),
        ("SEQ:PER 10000.6us", "SEQ:PER?", "0.010001"),
        ("TRIG:DEL 1.4us", "TRIG:DEL?", "0.000001"),
        ("TRIG:DEL 1.5us", "TRIG:DEL?", "0.000002"),
        ("*RST;:SEQ:PER MIN", "SEQ:PER?", "0.0097"),
        ("CAM:EXP 1ms;:SEQ:PER MIN", "SEQ:PER?", "0.0085"),
    ] {
        port.tell(order);
        assert_eq!(port.ask(query), answer, "{order}");
    }
    // A slower clock: times are multiples of 16 us.
    let mut port = self::port(|timing| timing.resolution_us = 16.0);
    port.tell("PROJ:EXP 9007us;:TRIG:DEL 8us");
    assert_eq!(port.ask("PROJ:EXP?;:TRIG:DEL?"), "0.009008;0.000016");
}

/// `PROJ:EXP? MAX` returns an exposure that can then be set, whatever the other settings are.
#[test]
fn the_longest_exposure_is_one_that_is_accepted() {
    let mut port = port(|_| {});
    // The readout takes 1.2 ms.
    for (order, longest) in [
        ("*RST", "0.0088"),
        ("SEQ:PER 20ms", "0.0188"),
        ("SEQ:PER 5", "0.5"),
    ] {
        port.tell(order);
        assert_eq!(port.ask("CAM:EXP? MAX"), longest, "{order}");
        port.tell("CAM:EXP MAX");
        assert_eq!(port.ask("CAM:EXP?"), longest, "{order}");
        port.tell("CAM:EXP MIN");
    }
}

#[test]
fn timing_beyond_the_controller_is_refused() {
    let mut port = port(|_| {});
    for (line, code) in [
        ("PROJ:EXP 9771us", -221),
        ("PROJ:EXP 10001us", -221),
        ("PROJ:EXP 8332us", -221),
        ("PROJ:EXP 61", -222),
        ("PROJ:EXP -1", -222),
        ("PROJ:EXP 1V", -131),
        ("CAM:EXP 8801us", -221),
        ("SEQ:PER 9699us", -221),
        ("CAM:EXP 1ms;:SEQ:PER 8700us", -221),
    ] {
        port.ask(line);
        assert_eq!(port.error(), code, "{line}");
    }
    assert_eq!(port.ask("PROJ:EXP?;:SEQ:PER?"), "0.0085;0.01", "as before");
    port.tell("CAM:EXP 1ms;:SEQ:PER 8730us");
    assert_eq!(port.ask("SEQ:PER? MIN"), "0.0085");
    // Two limits apply: the controller's margin and the dark times.
    let mut port = self::port(dark);
    assert_eq!(port.ask("PROJ:EXP? MAX"), "0.00977");
    port.ask("PROJ:EXP 10ms");
    assert_eq!(port.error(), -221);
    let reply = {
        port.ask("PROJ:EXP 9900us");
        port.ask("SYST:ERR?")
    };
    assert_eq!(
        reply,
        "-221,\"Settings conflict;patterns shown for 9900 us and 202 us of darkness, allowed at most \
         the period of 10000 us\""
    );
}

/// Returns what a shot sees, in order of time: the position in the selected sequence (`None` for
/// darkness) and the start time.
fn seen(port: &Port, shot: &Shot) -> Vec<(Option<usize>, u64)> {
    let pattern_images = &port.firmware.selected.pattern_images;
    let place = |pattern_image: &Option<std::sync::Arc<PatternImage>>| {
        let pattern_image = pattern_image.as_ref()?;
        Some(
            pattern_images
                .iter()
                .position(|s| s == pattern_image)
                .unwrap(),
        )
    };
    let then = shot
        .then
        .iter()
        .map(|s| (place(&s.pattern_image), s.from_ns));
    std::iter::once((place(&shot.pattern_image), shot.start_ns))
        .chain(then)
        .collect()
}

#[test]
fn patterns_and_exposures_come_when_they_are_due() {
    let mut port = port(|timing| {
        dark(timing);
        timing.trigger_delay_us = 25.0;
    });
    port.tell("TRIG:SOUR BUS;DEL 2ms;:CAM:EXP 8700us;:INIT");
    port.at(100 * MS);
    port.tell("*TRG");
    for i in 0..13 {
        let start = 102 * MS + 196 * US + i * 10 * MS;
        let read = start + 8700 * US + 1200 * US;
        assert_eq!(port.firmware.next_event_ns(), Some(read));
        port.at(read);
        let shot = port.shots.pop().unwrap().shot;
        assert_eq!((shot.start_ns, shot.end_ns()), (start, start + 8700 * US));
        // The pattern and the camera's exposure start together; the pattern ends first.
        let expected = [(Some(i as usize), start), (None, start + 8500 * US)];
        assert_eq!(seen(&port, &shot), expected);
    }
    // A trigger takes effect after a delay of 2.025 ms, so it may come that long before the end of
    // the last pattern's period.
    assert_eq!(port.firmware.state(), State::Idle);
    assert_eq!(port.firmware.next_event_ns(), None);
}

#[test]
fn a_camera_that_starts_with_the_period_sees_the_darkness_too() {
    let mut port = port(|timing| {
        dark(timing);
        timing.camera_delay_us = Some(0.0);
    });
    port.tell("TRIG:SOUR BUS;:CAM:EXP 8671us;:INIT;*TRG");
    port.at(9871 * US);
    let shot = port.shots.pop().unwrap().shot;
    assert_eq!(seen(&port, &shot), [(None, 0), (Some(0), 171 * US)]);
    // The shots that serve for ground truth contain the same patterns and dark intervals.
    port.at(1000 * MS);
    let sequence = port.firmware.selected_sequence();
    for ((_, asked), taken) in sequence[1..].iter().zip(&port.shots) {
        assert_eq!(
            (&asked.pattern_image, &asked.then),
            (&taken.shot.pattern_image, &taken.shot.then)
        );
    }
    port.tell("PROJ:POW OFF;:INIT;*TRG");
    port.shots.clear();
    port.at(2000 * MS);
    let mut shots = port.shots.iter().map(|e| &e.shot);
    assert!(
        shots
            .all(|s| s.pattern_image.is_none() && s.then.iter().all(|t| t.pattern_image.is_none()))
    );
}

#[test]
fn an_exposure_that_does_not_cover_a_grey_pattern_sees_bits() {
    let mut port = port(|_| {});
    port.tell("TRIG:SOUR BUS;:CAM:EXP 4250us;:INIT;*TRG");
    port.at(1000 * MS);
    let pattern_images = &port.firmware.selected.pattern_images;
    for (place, exposure) in port.shots.iter().enumerate() {
        let shot = &exposure.shot;
        if place >= 4 {
            assert_eq!(
                (&shot.pattern_image, shot.then.len()),
                (&Some(pattern_images[place].clone()), 0)
            );
            continue;
        }
        // Bit plane k is shown after (2^k - 1) / 255 of the 8.5 ms. The exposure ends after half of
        // that time, within bit plane 7.
        assert_eq!(
            shot.pattern_image.as_deref(),
            Some(&pattern_images[place].plane(0, 8))
        );
        let starts: Vec<_> = shot
            .then
            .iter()
            .map(|s| s.from_ns - shot.start_ns)
            .collect();
        let thirds = [1, 3, 7, 15, 31, 63, 127].map(|n| n * 100_000 / 3);
        assert_eq!(starts, thirds, "8.5 ms / 255 = 33333.3 ns");
        for (bit, showing) in (1..).zip(&shot.then) {
            assert_eq!(
                showing.pattern_image.as_deref(),
                Some(&pattern_images[place].plane(bit, 8))
            );
        }
    }
    // A pattern that is exposed for its whole time is not split into bit planes, nor is any pattern
    // of a projector without bit planes.
    port.tell("CAM:EXP 8500us;:INIT;*TRG");
    port.shots.clear();
    port.at(2000 * MS);
    assert!(port.shots.iter().all(|e| e.shot.then.is_empty()));
    let mut port = self::port(|timing| timing.bit_planes = false);
    port.tell("TRIG:SOUR BUS;:CAM:EXP 4250us;:INIT;*TRG");
    port.at(1000 * MS);
    assert!(port.shots.iter().all(|e| e.shot.then.is_empty()));
    assert_eq!(port.shots.len(), 13);
}

#[test]
fn a_trigger_that_comes_too_early_is_missed_and_counted() {
    for source in ["SOFT", "BUS", "EXT"] {
        let mut port = port(|_| {});
        port.tell(&format!("TRIG:SOUR {source};MODE STEP;:INIT"));
        let pulse = |port: &mut Port, at: u64| {
            port.at(at);
            match source {
                "SOFT" => drop(port.ask("TRIG")),
                "BUS" => drop(port.ask("*TRG")),
                _ => port.firmware.external_trigger(at),
            }
            port.error()
        };
        // Triggers come during the exposure, during the readout, within the pattern's period, and
        // in the nanosecond in which the device is ready.
        for (at, code, missed) in [
            (0, 0, "0;0"),
            (4 * MS, -211, "1;512"),
            (9 * MS, -211, "2;512"),
            (9_800 * US, -211, "3;512"),
            (10 * MS - 1, -211, "4;512"),
            (10 * MS, 0, "4;0"),
            (19_999 * US, -211, "5;512"),
            (300 * MS, 0, "5;0"),
        ] {
            assert_eq!(pulse(&mut port, at), code, "{source} {at}");
            assert_eq!(port.ask("TRIG:MISS?;:STAT:QUES?"), missed, "{source} {at}");
        }
        assert_eq!(port.ask("STAT:QUES:COND?"), "0");
        port.at(1000 * MS);
        let starts: Vec<_> = port.taken().iter().map(|shot| shot.2 / MS).collect();
        assert_eq!(starts, [0, 10, 300]);
        port.tell("*RST");
        assert_eq!(port.ask("TRIG:MISS?"), "0");
        // The device is not armed, so this trigger does not count as missed.
        port.tell("TRIG:SOUR BUS");
        assert_eq!(port.ask("*TRG;:TRIG:MISS?"), "0");
        assert_eq!(port.error(), -211);
    }
}

/// Without projector timing, a trigger is missed only if it comes during an exposure.
#[test]
fn device_without_timing_counts_missed_triggers() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR BUS;MODE STEP;:INIT;*TRG");
    port.ask("*TRG");
    assert_eq!((port.error(), port.ask("TRIG:MISS?").as_str()), (-211, "1"));
    port.at(12 * MS);
    port.tell("*TRG");
    assert_eq!(
        port.ask("PROJ:EXP?;EXP? MIN;:SEQ:PER?"),
        "0.016;0.016;0.016"
    );
    port.at(100 * MS);
    port.ask("PROJ:EXP 16ms");
    assert_eq!(port.error(), -221);
    // A camera with a shortest frame interval misses triggers within that interval.
    let mut profile = Profile::load("webcam-grey").unwrap();
    profile.camera.shortest_interval_us = Some(15_000.0);
    let mut port = Port::of(&profile);
    assert_eq!(port.ask("SEQ:PER? MIN"), "0.015");
    port.tell("CAM:EXP 1ms;:TRIG:SOUR BUS;MODE STEP;DEL 3ms;:INIT;*TRG");
    port.at(15 * MS - 1);
    port.ask("*TRG");
    assert_eq!((port.error(), port.ask("TRIG:MISS?").as_str()), (-211, "1"));
    port.at(15 * MS);
    port.tell("*TRG");
    port.at(100 * MS);
    let starts: Vec<_> = port.taken().iter().map(|shot| shot.2).collect();
    assert_eq!(starts, [3 * MS, 18 * MS]);
}

#[test]
fn a_sequence_takes_its_time_from_flash() {
    let mut port = port(|_| {});
    assert_eq!(port.ask("SEQ:SEL 'evm-4';*OPC?"), "1", "selected already");
    // 8 fringes of 8 bits and 16 patterns of one bit are 80 bit planes, which fill 4 buffers.
    port.tell("TRIG:SOUR BUS;:SEQ:SEL 'evm-4-xy'");
    assert_eq!(port.ask("*OPC?"), "");
    assert_eq!(port.at(800 * MS - 1), "");
    assert_eq!(port.firmware.next_event_ns(), Some(800 * MS));
    assert_eq!(port.at(800 * MS), "1\n");
    assert_eq!(port.firmware.next_event_ns(), None);
    // Arming waits for the load as well; commands that do not need the patterns do not wait.
    port.tell("SEQ:SEL 'evm-4'");
    assert_eq!(port.ask("STAT:OPER:COND?;:SEQ:COUN?"), "2;13");
    assert_eq!(port.ask("INIT;*TRG;:STAT:OPER:COND?"), "");
    assert_eq!(port.firmware.state(), State::Idle);
    assert_eq!(port.at(1199 * MS), "");
    assert_eq!(port.at(1200 * MS), "16\n");
    port.at(2000 * MS);
    assert_eq!(port.taken()[0].2, 1200 * MS);
    // With INITiate:CONTinuous ON the device arms itself. A trigger before the end of the load is
    // missed.
    port.tell("SEQ:SEL 'evm-4-xy';:TRIG:SOUR EXT;:INIT:CONT ON");
    port.firmware.external_trigger(2799 * MS);
    assert_eq!(
        port.ask("SYST:ERR?;:TRIG:MISS?;:STAT:OPER:COND?"),
        "-211,\"Trigger ignored;0.001 s too early: the sequence is still loaded\";1;34"
    );
    port.firmware.external_trigger(2800 * MS);
    port.at(5000 * MS);
    assert_eq!(port.taken().len(), 24);
}

/// After a sequence, `*OPC?` and `INITiate` wait until the last pattern's period has ended.
#[test]
fn sequences_follow_each_other_without_a_trigger_missed() {
    let mut port = port(|_| {});
    port.tell("TRIG:SOUR BUS;:INIT");
    assert_eq!(port.ask("*TRG;*OPC?"), "");
    assert_eq!(port.at(130 * MS - 1), "");
    assert_eq!(port.shots.len(), 13, "the last frame was read at 129.7 ms");
    assert_eq!(port.at(130 * MS), "1\n");
    port.tell("INIT;*TRG");
    port.at(259_700 * US);
    assert_eq!(port.ask("INIT;*TRG;:TRIG:MISS?"), "");
    assert_eq!(port.at(260 * MS), "0\n");
    port.at(1000 * MS);
    let starts: Vec<_> = port.taken().iter().map(|shot| shot.2 / MS).collect();
    assert_eq!(starts, (0..39).map(|i| i * 10).collect::<Vec<_>>());
}

#[test]
fn period_is_raised_for_own_patterns_that_take_longer() {
    let mut port = port(|timing| timing.exposure_us = None);
    port.tell("CAM:EXP 1ms;:SEQ:PER 9ms");
    let toml = "[projector]\nwidth_px = 912\nheight_px = 570\n[[frame]]\n\
                pattern = { kind = \"white\" }\n";
    port.bytes(format!("SEQ:DEF 'own',#2{}{toml}\n", toml.len()).as_bytes());
    assert_eq!(port.error(), 0);
    port.tell("SEQ:SEL 'own'");
    assert_eq!(port.ask("SEQ:PER?;:PROJ:EXP? MIN"), "0.01;0.000235");
    port.tell("SEQ:PER 4ms");
    port.ask("SEQ:SEL 'evm-4'");
    assert_eq!(port.error(), 0);
    assert_eq!(port.ask("SEQ:PER?"), "0.01");
    // The device's first sequence has only one-bit patterns and a period of 3 ms. A user-defined
    // sequence of 8-bit fringes gets the longer period that it needs.
    let mut profile = profile(|timing| timing.exposure_us = None);
    profile.camera.exposure_us = 1000.0;
    profile.sequence[0].frame.drain(..4);
    profile.sequence[0].period_us = 3000.0;
    let mut port = Port::of(&profile);
    let toml = "[projector]\nwidth_px = 912\nheight_px = 570\n[[frame]]\n\
                pattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 0 }\n";
    port.bytes(format!("SEQ:DEF 'own',#3{}{toml}\n", toml.len()).as_bytes());
    port.tell("SEQ:SEL 'own'");
    assert_eq!(port.ask("SEQ:PER?"), "0.008333");
}
