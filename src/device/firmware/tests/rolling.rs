//! A rolling shutter: end times of frames, allowed periods, and patterns that the last rows see.

use super::{MS, Port};
use crate::Shutter;
use phasmid_profile::Profile;

/// 480 rows of 20 us: the readout takes 9.6 ms, and the last row starts 9.58 ms after the first.
fn port() -> Port {
    let mut profile = Profile::load("webcam-grey").unwrap();
    profile.camera.line_time_us = 20.0;
    Port::of(&profile)
}

const SKEW: u64 = 479 * 20_000;

#[test]
fn a_frame_ends_with_its_last_row_and_the_next_one_does_not_wait() {
    let mut port = port();
    port.tell("TRIG:SOUR BUS;:SEQ:PER 12ms;:INIT;*TRG");
    for i in 0..13u64 {
        let ends = 12 * MS * i + 12 * MS + SKEW;
        assert_eq!(port.firmware.next_event_ns(), Some(ends));
        port.at(ends - 1);
        assert_eq!(port.shots.len(), 0);
        port.at(ends);
        let [exposure] = &port.shots[..] else {
            panic!("{:?}", port.shots)
        };
        let shot = &exposure.shot;
        assert_eq!((shot.start_ns, shot.end_ns()), (12 * MS * i, ends));
        let shutter = Shutter {
            line_time_ns: 20_000,
            first_row: 0,
            rows: 480,
        };
        assert_eq!(shot.shutter, shutter);
        // The next pattern is shown while the last rows are exposed; the last pattern stays on.
        let then = &shot.then[..];
        if i < 12 {
            let pattern_images = &port.firmware.selected.pattern_images;
            assert_eq!(then.len(), 1);
            assert_eq!(then[0].from_ns, 12 * MS * (i + 1));
            assert!(then[0].pattern_image.as_ref() == Some(&pattern_images[i as usize + 1]));
        } else {
            assert_eq!(then, []);
        }
        port.shots.clear();
    }
    assert_eq!(port.ask("STAT:OPER:COND?"), "0");
}

#[test]
fn long_period_or_step_trigger_avoids_leaking_patterns() {
    let mut port = port();
    port.tell("TRIG:SOUR BUS;:SEQ:PER 21.58ms;:INIT;*TRG");
    port.at(1000 * MS);
    port.tell("SEQ:PER 12ms;:TRIG:MODE STEP;:INIT");
    for i in 1..=13 {
        port.tell("*TRG");
        port.at(1000 * MS + i * 100 * MS);
    }
    assert_eq!(port.shots.len(), 26);
    assert!(port.shots.iter().all(|e| e.shot.then.is_empty()));
}

#[test]
fn projector_with_light_off_leaks_no_pattern() {
    let mut port = port();
    port.tell("PROJ:POW OFF;:TRIG:SOUR BUS;:SEQ:PER 12ms;:INIT;*TRG");
    port.at(1000 * MS);
    let shots = port.shots.iter().map(|e| &e.shot);
    assert!(
        shots
            .flat_map(|s| &s.then)
            .all(|then| then.pattern_image.is_none())
    );
}

#[test]
fn period_is_at_least_the_readout_of_all_rows() {
    let mut port = port();
    // With a short exposure, the readout of the rows limits the period.
    port.tell("CAM:EXP 1ms");
    assert_eq!(port.ask("SEQ:PER? MIN"), "0.0096");
    port.tell("SEQ:PER MIN");
    port.ask("SEQ:PER 9.5ms");
    assert_eq!(port.error(), -221);
    // With fewer rows a shorter period is allowed, and at that period a further row does not fit.
    port.tell("CAM:ROI 0,100,640,50;:SEQ:PER MIN");
    assert_eq!(port.ask("SEQ:PER?"), "0.001");
    port.ask("CAM:ROI 0,100,640,51");
    assert_eq!(port.error(), -221, "1.02 ms");
    port.ask("CAM:EXP 2ms");
    assert_eq!(port.error(), -221);
    port.tell("TRIG:SOUR BUS;:INIT;*TRG");
    port.at(1000 * MS);
    let shot = &port.shots[3].shot;
    assert_eq!((shot.shutter.first_row, shot.shutter.rows), (100, 50));
    assert_eq!(shot.end_ns() - shot.start_ns, MS + 49 * 20_000);
}

#[test]
fn a_selected_sequence_that_is_sent_again_has_to_fit_too() {
    let mut port = port();
    let toml = "[projector]\nwidth_px = 854\nheight_px = 480\n[[frame]]\n\
                pattern = { kind = \"white\" }\n";
    let define = format!("SEQ:DEF 'own',#2{}{toml}\n", toml.len());
    port.bytes(define.as_bytes());
    port.tell("SEQ:SEL 'own';PER 30ms;:CAM:EXP 20ms");
    // The new sequence would get the period of the device's first sequence, 16 ms, which is shorter
    // than the exposure.
    port.bytes(define.as_bytes());
    assert_eq!(port.error(), -221);
    port.tell("CAM:EXP 16ms");
    port.bytes(define.as_bytes());
    assert_eq!(port.error(), 0);
    assert_eq!(port.ask("SEQ:PER?"), "0.016");
}

#[test]
fn running_free_the_rows_bound_the_interval() {
    let mut port = port();
    port.tell("CAM:EXP 1ms;INT 2ms");
    assert_eq!(port.firmware.stream().interval_ns, 9_600_000);
    port.firmware.set_streaming(true, 0);
    port.at(50 * MS);
    let starts: Vec<_> = port.taken().iter().map(|shot| shot.2).collect();
    assert_eq!(starts, [0, 9_600_000, 19_200_000, 28_800_000, 38_400_000]);
    // After a long lag the camera skips frames; later exposures stay on the original grid of
    // intervals.
    port.at(5000 * MS);
    let late = port.taken()[0].2;
    assert_eq!(late % 9_600_000, 0);
    assert!(late > 4970 * MS && late + MS + SKEW <= 5000 * MS, "{late}");
}
