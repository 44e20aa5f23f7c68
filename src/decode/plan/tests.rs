//! Tests the plans of sequences, and the messages for sequences that cannot be decoded.

use super::*;

fn manifest(frames: &[(&str, f64, f64)]) -> Manifest {
    // (kind and axis, period or cell, phase or bit)
    let mut text = "[projector]\nwidth_px = 1920\nheight_px = 1080\n".to_owned();
    for (kind, a, b) in frames {
        let (kind, axis) = kind.split_once(' ').unwrap_or((kind, ""));
        let pattern = match kind {
            "fringe" => {
                format!("kind = \"fringe\", axis = \"{axis}\", period_px = {a}, phase_rad = {b}")
            }
            "gray" => {
                format!("kind = \"gray\", axis = \"{axis}\", cell_px = {a}, bits = 8, bit = {b}")
            }
            other => format!("kind = \"{other}\""),
        };
        text += &format!("[[frame]]\npattern = {{ {pattern} }}\n");
    }
    Manifest::parse(&text, "t").unwrap()
}

fn steps(period: f64, n: u32) -> Vec<(&'static str, f64, f64)> {
    (0..n)
        .map(|i| {
            (
                "fringe x",
                period,
                f64::from(i) * std::f64::consts::TAU / f64::from(n),
            )
        })
        .collect()
}

fn error(frames: &[(&'static str, f64, f64)]) -> String {
    Plan::new(&manifest(frames)).unwrap_err().to_string()
}

#[test]
fn errors_name_the_missing_patterns() {
    let gray = |skip: f64| {
        (0..7)
            .map(f64::from)
            .filter(move |&b| b != skip)
            .map(|b| ("gray x", 16.0, b))
            .collect::<Vec<_>>()
    };
    for (frames, needles) in [
        (
            [steps(16.0, 4), gray(3.0)].concat(),
            vec!["Gray bit 3", "axis x"],
        ),
        ([steps(16.0, 4), gray(6.0)].concat(), vec!["Gray bit 6"]),
        ([gray(2.0)].concat(), vec!["Gray bit 2"]),
        (
            [steps(16.0, 2), gray(9.0)].concat(),
            vec!["2 steps", "period 16 px"],
        ),
        (
            [steps(8.0, 4), gray(9.0)].concat(),
            vec!["cells of 16 px", "8"],
        ),
        (
            [steps(16.0, 4), steps(24.0, 4)].concat(),
            vec!["repeat after 48", "1920", "Gray"],
        ),
        (
            vec![("white", 0.0, 0.0)],
            vec!["neither fringes nor Gray code"],
        ),
        (gray(9.0), vec!["threshold", "white and a black"]),
    ] {
        let message = error(&frames);
        for needle in needles {
            assert!(message.contains(needle), "{needle} not in: {message}");
        }
    }
}

#[test]
fn a_hole_below_a_code_that_is_fine_enough_is_only_noted() {
    let mut frames = steps(16.0, 4);
    frames.extend((0..7).map(|b| ("gray x", 16.0, f64::from(b))));
    frames.push(("gray x", 4.0, 0.0));
    let plan = Plan::new(&manifest(&frames)).unwrap();
    assert_eq!(plan.axes[0].gray.as_ref().unwrap().cell_px, 16.0);
    assert!(plan.notes[0].contains("Gray bit 1 of the cells of 4 px"));
}

#[test]
fn one_set_alone_is_wrapped_and_beats_are_found() {
    let plan = Plan::new(&manifest(&steps(16.0, 3))).unwrap();
    assert_eq!(plan.axes[0].order, Order::Wrapped { period_px: 16.0 });
    let frames = [steps(66.6666666667, 3), steps(100.0, 3)].concat();
    assert!(error(&frames).contains("repeat after 200.0"));
    let frames = [steps(64.0, 3), steps(70.0, 3)].concat();
    let plan = Plan::new(&manifest(&frames)).unwrap();
    assert_eq!(
        plan.axes[0].order,
        Order::Resolved {
            repeat_px: f64::INFINITY
        }
    );
}
