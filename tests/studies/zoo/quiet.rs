//! Frames almost without noise. Effects that the decoder's model does not describe then exceed the
//! noise, and must not cause pixels or frames to be rejected.

use crate::zoo::setup::{Setup, Subject, fringes, gray, references};

#[test]
fn frames_almost_without_noise_are_decoded() {
    for (w, bits) in [
        (0.7, 12),
        (0.7, 16),
        (1.0, 12),
        (1.0, 16),
        (1.6, 12),
        (1.6, 16),
    ] {
        let code = |steps| [fringes(19.0, steps), gray(9.5, false), references()].concat();
        let periods = [fringes(19.0, 4), fringes(150.0, 4), fringes(1127.0, 4)].concat();
        for (name, patterns) in [
            ("4 steps", code(4)),
            ("5 steps", code(5)),
            ("3 periods", periods),
        ] {
            let setup = Setup {
                w,
                blur: None,
                bits,
                full_well_e: 1e7,
                read_noise_e: 0.0,
                subject: Subject::Bump,
                patterns,
            };
            let found = setup.scan();
            let place = format!(
                "w {w} {bits} bits {name}: coverage {:.4} error / sigma {:.3} beyond {:.5} {:?} {}",
                found.coverage, found.ratio, found.beyond, found.checked, found.notes
            );
            println!("{place}");
            assert!(found.coverage >= 0.99, "{place}");
            assert_eq!(found.checked, Ok(()), "{place}");
            // Within a held pixel's plateau the true coordinate is barely known, and a model error of
            // thousandths of a pixel decides whether a coordinate belongs to the plateau.
            let (most, few) = if w < 0.9 { (1.3, 0.007) } else { (1.15, 0.002) };
            assert!(found.ratio <= most && found.beyond <= few, "{place}");
        }
    }
}
