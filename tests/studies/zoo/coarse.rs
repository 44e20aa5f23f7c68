//! Gray code whose finest bits the camera does not resolve: the bits that can be read are used.

use crate::zoo::setup::{Blurred, Setup, Subject, fringes, gray, references};

/// A Gray code.
#[derive(Clone, Copy, Debug)]
struct Code {
    cell_px: u32,
    /// Each bit is followed by its complement; otherwise white and black follow the code.
    pairs: bool,
    /// Fringes of 16 px precede the code.
    fringes: bool,
}

impl Code {
    fn patterns(self) -> Vec<String> {
        let mut all = Vec::new();
        if self.fringes {
            all.extend(fringes(16.0, 4));
        }
        all.extend(gray(self.cell_px.into(), self.pairs));
        if !self.pairs {
            all.extend(references());
        }
        all
    }
}

#[test]
fn gray_bits_that_the_camera_does_not_resolve_are_left_out() {
    every_second_setting(0);
}

#[test]
#[ignore = "10 s; a lane of .ci/run --whole"]
fn gray_bits_that_the_camera_does_not_resolve_are_left_out_in_further_settings() {
    every_second_setting(1);
}

/// Tests every second combination of a blur and a code, from the first or the second one on.
fn every_second_setting(first: usize) {
    let mut number = first;
    let code = |cell_px, pairs, fringes| Code {
        cell_px,
        pairs,
        fringes,
    };
    let codes = [
        code(1, false, false),
        code(1, true, false),
        code(1, false, true),
        code(1, true, true),
        code(2, false, true),
    ];
    for blur in [Blurred::Camera, Blurred::Projector] {
        for (disc, most_resolved) in [(1.0, 1), (4.0, 2), (10.0, 8)] {
            for code in codes {
                number += 1;
                if number.is_multiple_of(2) {
                    continue;
                }
                let setup = Setup {
                    w: 1.2,
                    blur: Some((blur, disc)),
                    bits: 8,
                    full_well_e: 10_000.0,
                    read_noise_e: 5.0,
                    subject: Subject::Bump,
                    patterns: code.patterns(),
                };
                let found = setup.scan();
                let place = format!(
                    "{blur:?} disc {disc} px {code:?}: coverage {:.4} error / sigma {:.3} beyond \
                     {:.5} sigma {:.3} px {}",
                    found.coverage, found.ratio, found.beyond, found.sigma, found.notes
                );
                println!("{place}");
                assert!(found.coverage >= 0.97, "{place}");
                assert!(found.beyond <= 0.001, "{place}");
                assert_eq!(found.checked, Ok(()), "{place}");
                let left_out = found.notes.contains("left out (contrast of the finest");
                assert_eq!(left_out, code.cell_px < most_resolved, "{place}");
                if code.fringes {
                    assert!((0.9..=1.15).contains(&found.ratio), "{place}");
                } else {
                    // Errors are at most half a cell, and smaller where blur helps to locate an edge.
                    assert!(found.ratio <= 1.0, "{place}");
                    let cells = f64::from(found.sigma) * 12f64.sqrt();
                    assert!(cells < 1.01 * f64::from(most_resolved), "{place}");
                }
            }
        }
    }
}
