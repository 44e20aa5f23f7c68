//! The page of the study.

use super::bound::{floor_of_many, rounded};
use super::tables::{self, WHITE_FROM_DN, bench, of, signal_to_noise, spoken_of, values};
use phasmid_report::lab::{Block, Chart, Check, Row, Rows, Section, Series, SeriesStyle};

/// Maximum ratio of errors to the bound.
const ABOVE_BOUND: f64 = 1.05;
/// Number of phase steps that Wu et al. use, for tables with a single number of steps.
const STEPS: f64 = 12.0;

/// Returns all sections.
pub(super) fn of_rows(rows: &Rows) -> Vec<Section> {
    let section = |title: &str, blocks| Section::new(title, blocks);
    vec![
        section("Even noise: least squares and rounding", even(rows)),
        section("Even noise: inliers, gross errors, coverage", mask(rows)),
        section("Shot noise: benefit of weights", shot(rows)),
        section("Depth", depth(rows)),
        section("Checks", vec![Block::Checks(checks(rows))]),
    ]
}

fn even(rows: &Rows) -> Vec<Block> {
    let words = "Fringes around the middle of 8 bits with Gaussian noise of equal size at every \
        step, rounded and decoded as in a scan. The bound is sqrt(2/N) sigma/B with sigma^2 = \
        noise^2 + 1/12, which treats rounding as white noise. This holds from a noise of 0.3 grey \
        levels upwards, for every number of steps. Below that, samples of one fringe that share a \
        level also share its rounding error: at 0.1 grey levels the phase error is up to a quarter \
        above or below that bound, depending on steps and modulation. Not only few steps are \
        affected: 10, 12, 24 and 32 steps have modulations at which the error is a tenth or more \
        above the bound, so that no limit of 1.05 for five or more steps can hold there. The \
        second table is the closed form of the harmonics due to rounding; below a noise of half a \
        grey level, the measured errors are checked against it, above, against the bound of white \
        noise.";
    let measured = "RMS error divided by the bound: largest value over the modulations (bins of a \
        thousand valid samples or more)";
    let expected = "RMS error expected for rounded samples, divided by the bound: largest value \
        over the modulations";
    let blocks = [
        Block::Words(words.to_owned()),
        Block::Table(tables::by_steps_and_noise(
            rows,
            "noise-even",
            measured,
            |row| row.value("ratio"),
        )),
        Block::Table(tables::by_steps_and_noise(
            rows,
            "noise-rounded",
            expected,
            |row| row.value("rounded"),
        )),
        figure(
            "noise-ratio-steps",
            "Error over the bound by steps",
            over_steps(rows),
        ),
        figure("noise-bound", "Measured against bound", against_bound(rows)),
    ];
    blocks.into()
}

fn mask(rows: &Rows) -> Vec<Block> {
    let words = "A pixel is valid if its measured modulation is at least 2 DN, its phase has a \
        measured standard deviation of at most 0.15 rad, its Gray code is certain, and its \
        neighbours confirm it. The Gray code is the first to reject pixels: a bit is certain if it \
        is four standard deviations from the middle of white and black, which is noisy itself. \
        That takes a modulation of about eight times the noise, whereas the phase of twelve steps \
        reaches 0.15 rad from three times on. No gross errors pass. Where some pixels are \
        rejected, the valid ones are those whose noise happened to increase their modulation.";
    let blocks = [
        Block::Words(words.to_owned()),
        Block::Table(tables::mask(rows, STEPS)),
        figure(
            "noise-ratio",
            "Inliers: error over the bound",
            over_noise(rows, "error over the bound", |row| {
                if spoken_of(row) {
                    row.value("ratio")
                } else {
                    f64::NAN
                }
            }),
        ),
        figure(
            "noise-coverage",
            "Coverage",
            over_noise(rows, "coverage", |row| {
                row.value("valid") / row.value("samples")
            }),
        ),
        figure(
            "noise-gross",
            "Gross errors",
            over_noise(rows, "gross errors among valid pixels", |row| {
                row.value("gross") / row.value("valid")
            }),
        ),
    ];
    blocks.into()
}

fn shot(rows: &Rows) -> Vec<Block> {
    let words = "Where noise follows the light, the dark samples of a fringe are more precise than \
        the bright ones. Least squares ignores this and has the same bound as before, with sigma \
        at the mean. For many steps, the Cramer-Rao bound is lower by sqrt((1 + sqrt(1 - m^2)) / \
        2), where m is the relative amplitude of the variance along the fringe. Option weighted \
        (--weighted) subtracts the part of the phase error that correlates with the second and \
        third harmonics of the samples, which contain only noise. Response curves shift the phase \
        of neither method.";
    let blocks = [
        Block::Words(words.to_owned()),
        Block::Table(tables::sensors(rows, STEPS)),
        Block::Table(tables::steps(rows)),
        figure(
            "noise-weighted",
            "Error of least squares and of weighted steps over the least-squares bound",
            over_swing(rows),
        ),
        Block::Table(tables::time(rows)),
    ];
    blocks.into()
}

fn depth(rows: &Rows) -> Vec<Block> {
    let words = "Scenes are rendered, captured and decoded repeatedly, each time with new noise. \
        The spread of a pixel's depth is noise only; its mean contains the errors that are not \
        noise: the 8 bits of the pattern images, rounding, and the remainder after the correction \
        of held projector pixels. On webcam-grey, whose four steps get no weights, that correction \
        raises the noise a little. First-order propagation converts the phase's bound to depth \
        with the slope of the projector's coordinate along the camera's ray.";
    vec![
        Block::Words(words.to_owned()),
        Block::Table(tables::depths(rows)),
    ]
}

fn figure(name: &str, caption: &str, chart: Chart) -> Block {
    Block::Figure(chart.figure(name, caption))
}

/// Plots error over bound by steps at one modulation, with a series for each noise.
fn over_steps(rows: &Rows) -> Chart {
    const MODULATION_DN: f64 = 10.0;
    let mut series = Vec::new();
    for noise in values(of(rows, "even"), "nominal_dn") {
        let here = || {
            of(rows, "even").filter(|row| {
                row.value("nominal_dn") == noise
                    && row.value("modulation_dn") == MODULATION_DN
                    && spoken_of(row)
            })
        };
        let points = here().map(|row| (row.value("steps"), row.value("ratio")));
        series.push(Series::new(
            &format!("noise {noise} DN"),
            SeriesStyle::Both,
            points,
        ));
    }
    let expected = (3..=32u32).map(|n| (f64::from(n), rounded(n as usize, MODULATION_DN, 0.1)));
    series.push(Series::new(
        "expected at 0.1 DN",
        SeriesStyle::Dashed,
        expected,
    ));
    Chart {
        heading: format!("B = {MODULATION_DN} DN"),
        x: "steps N".to_owned(),
        y: "error over the bound".to_owned(),
        log: [true, false],
        series,
    }
}

/// Plots a value over the ratio of modulation to noise, with a series for each number of steps.
fn over_noise(rows: &Rows, label: &str, value: impl Fn(&Row) -> f64) -> Chart {
    let series = values(of(rows, "even"), "steps").into_iter().map(|steps| {
        let mut points: Vec<(f64, f64)> = of(rows, "even")
            .filter(|row| row.value("steps") == steps)
            .map(|row| (signal_to_noise(row), value(row)))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Series::new(&format!("N = {steps}"), SeriesStyle::Dots, points)
    });
    Chart {
        heading: String::new(),
        x: "modulation B over noise".to_owned(),
        y: label.to_owned(),
        log: [true, false],
        series: series.collect(),
    }
}

/// Plots errors over bounds, in projector pixels.
fn against_bound(rows: &Rows) -> Chart {
    let points = |kind: &'static str, low: bool| {
        let here = of(rows, kind).filter(|row| spoken_of(row));
        here.filter(move |row| (row.value("noise_dn") < WHITE_FROM_DN) == low)
            .map(|row| (row.value("bound_px"), row.value("rms_px")))
            .collect::<Vec<_>>()
    };
    let bounds = || of(rows, "even").map(|row| row.value("bound_px"));
    let ends = [
        bounds().fold(f64::NAN, f64::min),
        bounds().fold(f64::NAN, f64::max),
    ];
    Chart {
        heading: String::new(),
        x: "least-squares bound, projector px".to_owned(),
        y: "root mean square error, projector px".to_owned(),
        log: [true, true],
        series: vec![
            Series::new(
                "even, 0.5 DN or more",
                SeriesStyle::Dots,
                points("even", false),
            ),
            Series::new(
                "even, below 0.5 DN",
                SeriesStyle::Dots,
                points("even", true),
            ),
            Series::new("sensors", SeriesStyle::Dots, points("shot", false)),
            Series::new(
                "sensors, below 0.5 DN",
                SeriesStyle::Dots,
                points("shot", true),
            ),
            Series::new("bound", SeriesStyle::Dashed, ends.map(|end| (end, end))),
        ],
    }
}

/// Plots errors of least squares and of weighted steps, relative to the bound, over the amplitude of
/// the variance.
fn over_swing(rows: &Rows) -> Chart {
    let here = || of(rows, "shot").filter(|row| row.value("steps") >= 8.0 && spoken_of(row));
    let points = |name: &'static str| here().map(move |row| (row.value("swing"), row.value(name)));
    let bound = (0..=95)
        .map(|i| f64::from(i) / 100.0)
        .map(|m| (m, floor_of_many(m)));
    Chart {
        heading: "8 steps and more".to_owned(),
        x: "relative amplitude m of the variance".to_owned(),
        y: "error over the least-squares bound".to_owned(),
        log: [false, false],
        series: vec![
            Series::new("least squares", SeriesStyle::Dots, points("ratio")),
            Series::new("weighted", SeriesStyle::Dots, points("weighted_ratio")),
            Series::new("Cramer-Rao bound", SeriesStyle::Dashed, bound),
        ],
    }
}

fn checks(rows: &Rows) -> Vec<Check> {
    let phases = || {
        of(rows, "even")
            .chain(of(rows, "shot"))
            .filter(|row| spoken_of(row))
    };
    let white = |row: &&Row| row.value("noise_dn") >= WHITE_FROM_DN * (1.0 - 1e-3);
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NAN, f64::max);
    let off = |value: f64| (value - 1.0).abs();
    let weighable = |row: &&Row| row.value("steps") >= 8.0;
    let of_all = || of(rows, "even").chain(of(rows, "shot"));
    let gross: f64 = of_all().map(|row| row.value("gross")).sum();
    let valid: f64 = of_all().map(|row| row.value("valid")).sum();
    let bench_m = |row: &&Row| {
        bench(row) && row.value("steps") == STEPS && row.value("modulation_dn") >= 50.0
    };
    vec![
        Check::at_most(
            "error over the least-squares bound, noise of 0.5 DN or more",
            largest(&mut phases().filter(white).map(|row| row.value("ratio"))),
            ABOVE_BOUND,
        ),
        Check::at_most(
            "error over the error expected for rounded samples, noise below 0.5 DN",
            largest(
                &mut phases()
                    .filter(|row| !white(row))
                    .map(|row| row.value("ratio") / row.value("rounded")),
            ),
            ABOVE_BOUND,
        ),
        Check::at_most(
            "error over the decoder's stated sigma, minus 1, noise of 0.5 DN or more",
            largest(&mut phases().filter(white).map(|row| off(row.value("whitened")))),
            0.05,
        ),
        Check::at_most(
            "gross errors among all valid pixels of fringes",
            gross / valid,
            1e-4,
        ),
        Check::at_most(
            "weighted: error over the Cramer-Rao bound, 8 steps or more, noise of 0.5 DN or more",
            largest(
                &mut phases()
                    .filter(white)
                    .filter(weighable)
                    .map(|row| row.value("weighted_ratio") / row.value("floor")),
            ),
            ABOVE_BOUND,
        ),
        Check::at_most(
            "weighted: error over the stated sigma, minus 1, noise of 0.5 DN or more",
            largest(
                &mut phases()
                    .filter(white)
                    .map(|row| off(row.value("weighted_whitened"))),
            ),
            0.05,
        ),
        Check::at_most(
            "weighted error over least-squares error, pmp-bench's sensor, 12 steps, B of 50 DN or more",
            largest(
                &mut of(rows, "shot")
                    .filter(bench_m)
                    .map(|row| row.value("weighted_ratio") / row.value("ratio")),
            ),
            0.95,
        ),
        Check::at_most(
            "depth: spread over the bound, 12 steps",
            largest(
                &mut of(rows, "depth")
                    .filter(|row| row.get("sensor") != "webcam-grey")
                    .map(|row| row.value("ratio")),
            ),
            ABOVE_BOUND,
        ),
        Check::at_most(
            "depth: error over the bound",
            largest(&mut of(rows, "depth").map(|row| {
                row.value("spread_mm").hypot(row.value("bias_mm")) / row.value("bound_mm")
            })),
            // The correction of held pixels adds a few percent of noise.
            1.15,
        ),
        Check::at_most(
            "depth: chi-square of the stated sigma, minus 1",
            largest(&mut of(rows, "depth").map(|row| off(row.value("chi_square")))),
            0.05,
        ),
        Check::at_most(
            "depth, weighted: chi-square of the stated sigma, minus 1",
            largest(&mut of(rows, "depth").map(|row| off(row.value("weighted_chi_square")))),
            0.05,
        ),
    ]
}
