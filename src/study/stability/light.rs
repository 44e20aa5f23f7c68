//! The light source: time constants with a ratio of up to a billion, and exposures over seven decades.

use super::case::{Case, Group, Sweep};
use phasmid_core::statistics::gauss_legendre;
use phasmid_profile::{Droop, Led, Profile};
use phasmid_render::led::{Model, Source, State};

/// Accuracy that the light model states; the model's own tests compare it with solutions of 100 digits.
const ALLOWED: f64 = 1e-14;
/// Fraction of the light lost by heating.
const SHARE: f64 = 0.4;

pub(super) const GROUP: Group = Group {
    title: "Light source",
    sweeps: &[
        Sweep {
            key: "constants",
            title: "A rise time of nanoseconds and thermal time constants of up to eleven days",
            oracle: "Mean light of exposures of 1 us to 10 s, switched on cold and switched off \
                warm, compared with Gauss-Legendre quadrature of the solution on geometric \
                intervals, whose terms are all positive. Allowed: 1e-14, the stated accuracy of \
                the light source",
            ratio: "heat over rise",
            error: "relative error",
            rounding: true,
            cases: |_| Ok(by_constants()),
        },
        Sweep {
            key: "exposures-light",
            title: "Exposures from 1 us to 10 s of a source with a rise time of 1 ms",
            oracle: "As before, with thermal time constants of 1 ms to eleven days: from equal to \
                the rise time to a billion times as long",
            ratio: "exposure over rise",
            error: "relative error",
            rounding: true,
            cases: |_| Ok(by_exposures()),
        },
        Sweep {
            key: "late-light",
            title: "Light of a source after a billion frames",
            oracle: "A source that is switched on then gives the same light as one that is \
                switched on at time 0, because device time is in integer nanoseconds. Allowed: \
                rounding",
            ratio: "frames of 20 ms",
            error: "relative error",
            rounding: true,
            cases: |_| Ok(late()),
        },
        Sweep {
            key: "source-limits",
            title: "Invalid constants of a light source",
            oracle: "A profile with these constants must be refused",
            ratio: "constant over its limit",
            error: "-",
            rounding: false,
            cases: |_| Ok(limits()),
        },
    ],
};

/// Creates a source with these time constants.
fn led(rise_ns: f64, heat_s: f64) -> Led {
    Led {
        // The rise time in a profile is from 10 to 90 per cent.
        rise_us: rise_ns * 9f64.ln() * 1e-3,
        droop: vec![Droop {
            time_constant_s: heat_s,
            fraction: SHARE,
        }],
    }
}

/// Returns the mean of a function over [0, end], integrated over intervals that shrink towards 0 by
/// factors of sqrt(2).
fn mean(nodes: &[(f64, f64)], end: f64, of: impl Fn(f64) -> f64) -> f64 {
    let factor = std::f64::consts::FRAC_1_SQRT_2;
    let (mut high, mut sum) = (1.0, 0.0);
    for k in 0..160 {
        let low = if k == 159 { 0.0 } else { high * factor };
        let half = 0.5 * (high - low);
        let part: f64 = nodes
            .iter()
            .map(|(x, w)| w * of(end * (low + half * (1.0 + x))))
            .sum();
        sum += half * part;
        high = low;
    }
    sum
}

/// Returns the relative error of the mean light over an exposure, the larger of switching on and off.
fn worst(nodes: &[(f64, f64)], [rise_ns, heat_ns]: [f64; 2], exposure_ns: f64) -> f64 {
    let led = led(rise_ns, heat_ns * 1e-9);
    let model = Model::new(&led);
    // Use the model's time constants, including their rounding.
    let rise_ns = led.rise_us * 1e3 / 9f64.ln();
    let heat_ns = led.droop[0].time_constant_s * 1e9;
    let gone = |t: f64, constant: f64| -(-t / constant).exp_m1();
    let left = |t: f64, constant: f64| (-t / constant).exp();
    let on = |t: f64| gone(t, rise_ns) * (1.0 - SHARE * gone(t, heat_ns));
    let off = |t: f64| left(t, rise_ns) * (1.0 - SHARE * left(t, heat_ns));
    let error = |state: &State, drive: f64, exact: f64| {
        (model.mean(state, drive, exposure_ns) / exact - 1.0).abs()
    };
    let cold = error(&model.off(), 1.0, mean(nodes, exposure_ns, on));
    let warm = error(&model.settled(1.0), 0.0, mean(nodes, exposure_ns, off));
    cold.max(warm)
}

const EXPOSURES_NS: [f64; 8] = [1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10];

fn by_constants() -> Vec<Case> {
    let nodes = gauss_legendre(20);
    let one = |ratio: f64| {
        let errors = EXPOSURES_NS.map(|exposure| worst(&nodes, [1.0, ratio], exposure));
        let found = errors.into_iter().fold(0.0, f64::max);
        Case::held(
            format!("1 ns and {}", duration(ratio)),
            ratio,
            found,
            ALLOWED,
        )
    };
    [1e3, 1e5, 1e7, 1e9, 1e11, 1e13, 1e15]
        .into_iter()
        .map(one)
        .collect()
}

fn by_exposures() -> Vec<Case> {
    let nodes = gauss_legendre(20);
    let one = |exposure: f64| {
        let heats = [1e6, 1.0001e6, 3e7, 1e9, 1e12, 1e15];
        let errors = heats.map(|heat| worst(&nodes, [1e6, heat], exposure));
        let found = errors.into_iter().fold(0.0, f64::max);
        Case::held(duration(exposure), exposure / 1e6, found, ALLOWED)
    };
    EXPOSURES_NS.into_iter().map(one).collect()
}

/// Formats nanoseconds with a suitable unit.
pub(super) fn duration(ns: f64) -> String {
    match ns {
        ns if ns < 1e6 => format!("{} us", ns / 1e3),
        ns if ns < 1e9 => format!("{} ms", ns / 1e6),
        ns => format!("{} s", ns / 1e9),
    }
}

fn late() -> Vec<Case> {
    let light = |start_ns: u64| {
        let mut source = Source::new(Model::new(&Led {
            rise_us: 4.0,
            ..led(1.0, 90.0)
        }));
        source.drive(start_ns, 1.0);
        let emission = source.emission(start_ns);
        emission.mean(start_ns + 1_000_003, start_ns + 9_000_007)
    };
    let first = light(0);
    [1u64, 1_000_000, 1_000_000_000, 1_000_000_000_000 / 20]
        .map(|frames| {
            let found = (light(frames * 20_000_000) / first - 1.0).abs();
            Case::held(format!("frame {frames}"), frames as f64, found, ALLOWED)
        })
        .to_vec()
}

fn limits() -> Vec<Case> {
    let text = phasmid_device_profiles::WEBCAM_GREY;
    let place = text.find("[[sequence]]").unwrap_or(text.len());
    let (before, after) = text.split_at(place);
    let refused = |name: &str, ratio: f64, led: &str, words: &str| {
        let profile = Profile::parse(&format!("{before}{led}\n{after}"), "device.toml");
        let says = profile.map_or_else(|e| e.to_string(), |_| String::new());
        Case::refused(name, ratio, &says, words)
    };
    let droop = |time: &str, share: &str| {
        format!(
            "[projector.led]\nrise_us = 1\n[[projector.led.droop]]\ntime_constant_s = {time}\nfraction = {share}\n"
        )
    };
    vec![
        refused(
            "rise time of zero",
            0.0,
            "[projector.led]\nrise_us = 0\n",
            "projector.led.rise_us",
        ),
        refused(
            "rise time of a femtosecond",
            1e-6,
            "[projector.led]\nrise_us = 1e-9\n",
            "projector.led.rise_us",
        ),
        refused(
            "thermal time constant of thirty years",
            1e3,
            &droop("1e9", "0.1"),
            "time_constant_s",
        ),
        refused(
            "thermal time constant of zero",
            0.0,
            &droop("0", "0.1"),
            "time_constant_s",
        ),
        refused(
            "thermal loss of all light",
            1.1,
            &droop("9", "1.0"),
            "fraction",
        ),
    ]
}
