//! The tables.

use phasmid_report::lab::{Row, Rows, Table};
use phasmid_report::plot::figures;

/// Minimum number of valid samples of a bin in a table.
pub(super) const FEWEST: f64 = 1000.0;
/// Minimum noise in digital numbers at which rounding is white.
pub(super) const WHITE_FROM_DN: f64 = 0.5;

/// Returns the rows of one kind.
pub(super) fn of<'a>(rows: &'a Rows, kind: &'a str) -> impl Iterator<Item = &'a Row> {
    rows.with("kind", kind)
}

/// Returns whether a phase row has enough valid samples to be reported.
pub(super) fn spoken_of(row: &Row) -> bool {
    row.value("valid") - row.value("gross") >= FEWEST
}

/// Returns the distinct values of a column in ascending order.
pub(super) fn values<'a>(rows: impl Iterator<Item = &'a Row>, name: &str) -> Vec<f64> {
    let mut values: Vec<f64> = rows.map(|row| row.value(name)).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// Returns the modulation over the standard deviation of a sample, rounding included.
pub(super) fn signal_to_noise(row: &Row) -> f64 {
    row.value("modulation_dn") / (row.value("noise_dn").powi(2) + 1.0 / 12.0).sqrt()
}

/// Tabulates, for each number of steps and each noise level, the largest value over the bins.
pub(super) fn by_steps_and_noise(
    rows: &Rows,
    name: &str,
    caption: &str,
    value: impl Fn(&Row) -> f64,
) -> Table {
    let noises = values(of(rows, "even"), "nominal_dn");
    let header: Vec<String> = std::iter::once("N".to_owned())
        .chain(noises.iter().map(|noise| format!("{noise} DN")))
        .collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = Table::new(name, caption, &header);
    for steps in values(of(rows, "even"), "steps") {
        let cells = noises.iter().map(|&noise| {
            let largest = of(rows, "even")
                .filter(|row| row.value("steps") == steps && row.value("nominal_dn") == noise)
                .filter(|row| spoken_of(row))
                .map(&value)
                .fold(f64::NAN, f64::max);
            figures(largest, 3)
        });
        table.row(std::iter::once(steps.to_string()).chain(cells));
    }
    table
}

/// Tabulates the effect of the mask as the noise grows: inliers, gross errors and coverage separately.
pub(super) fn mask(rows: &Rows, steps: f64) -> Table {
    let caption = format!(
        "Even noise, {steps} steps, from the noisiest fringe to the best. Coverage: share of valid \
         pixels; gross: share of the valid pixels that are more than a quarter of a period off; \
         error over bound: RMS of the other valid pixels"
    );
    let header = [
        "B over noise",
        "B, DN",
        "noise, DN",
        "coverage, %",
        "gross, %",
        "error over bound",
        "error over stated sigma",
    ];
    let mut table = Table::new("noise-mask", caption, &header);
    let mut found: Vec<&Row> = of(rows, "even")
        .filter(|row| row.value("steps") == steps)
        .collect();
    found.sort_by(|a, b| signal_to_noise(a).total_cmp(&signal_to_noise(b)));
    for row in found {
        let valid = row.value("valid");
        let gross = if valid > 0.0 {
            row.value("gross") / valid
        } else {
            f64::NAN
        };
        let few = |value: f64| if spoken_of(row) { value } else { f64::NAN };
        table.row([
            figures(signal_to_noise(row), 3),
            row.get("modulation_dn").to_owned(),
            row.get("nominal_dn").to_owned(),
            figures(100.0 * valid / row.value("samples"), 3),
            figures(100.0 * gross, 2),
            figures(few(row.value("ratio")), 3),
            figures(few(row.value("whitened")), 3),
        ]);
    }
    table
}

/// Tabulates shot noise (least squares, weights and bound) over the sensors and modulations for one
/// number of steps.
pub(super) fn sensors(rows: &Rows, steps: f64) -> Table {
    let caption = format!(
        "Sensors of profiles, {steps} steps, fringes without other light (B is 95 % of the mean's \
         height above black). Swing: relative amplitude of the variance along the fringe, m = K B \
         / v. The last three columns are RMS errors divided by the least-squares bound"
    );
    let header = [
        "sensor",
        "gain, dB",
        "B, DN",
        "noise, DN",
        "swing m",
        "coverage, %",
        "least squares",
        "weighted",
        "Cramer-Rao",
    ];
    let mut table = Table::new("noise-sensors", caption, &header);
    for row in of(rows, "shot").filter(|row| row.value("steps") == steps) {
        table.row([
            row.get("sensor").to_owned(),
            row.get("gain_db").to_owned(),
            row.get("modulation_dn").to_owned(),
            figures(row.value("noise_dn"), 3),
            figures(row.value("swing"), 3),
            figures(100.0 * row.value("valid") / row.value("samples"), 3),
            figures(row.value("ratio"), 3),
            figures(row.value("weighted_ratio"), 3),
            figures(row.value("floor"), 3),
        ]);
    }
    table
}

/// Tabulates shot noise over the numbers of steps, for the first sensor at its brightest fringe.
pub(super) fn steps(rows: &Rows) -> Table {
    let all = || of(rows, "shot").filter(|row| bench(row));
    let brightest = values(all(), "modulation_dn").pop().unwrap_or(f64::NAN);
    let caption = format!(
        "The sensor of pmp-bench by number of steps, B = {brightest} DN: RMS errors divided by the \
         least-squares bound. Three steps have no redundancy for weights, and the decoder applies \
         weights from six steps on"
    );
    let header = ["N", "least squares", "weighted", "Cramer-Rao"];
    let mut table = Table::new("noise-steps", caption, &header);
    for row in all().filter(|row| row.value("modulation_dn") == brightest) {
        table.row([
            row.get("steps").to_owned(),
            figures(row.value("ratio"), 3),
            figures(row.value("weighted_ratio"), 3),
            figures(row.value("floor"), 3),
        ]);
    }
    table
}

/// Returns whether a row has the default profile's sensor at its own gain.
pub(super) fn bench(row: &Row) -> bool {
    row.get("sensor") == "pmp-bench" && row.value("gain_db") == 0.0
}

/// Tabulates depths of repeatedly scanned scenes.
pub(super) fn depths(rows: &Rows) -> Table {
    let caption = "Depth of smooth pixels over repeated scans of the middle of the camera's image, \
         RMS in mm. Bound: sqrt(2/N) sigma/B of the truth, converted to depth. Spread: standard \
         deviation of each pixel's depths. Deviation: standard deviation stated by the decoder. \
         Bias: of the mean depths from the true ones, less the noise that remains in a mean. \
         Chi-square: mean squared ratio of error to stated standard deviation. Gross: points more \
         than 1 mm off. Beyond 5 sigma: points off by more than 5 stated standard deviations";
    let header = [
        "profile, scene, light",
        "scans",
        "pixels",
        "B, DN",
        "swing m",
        "coverage, %",
        "gross, %",
        "beyond 5 sigma, %",
        "bound",
        "spread",
        "deviation",
        "spread over bound",
        "chi-square",
        "bias",
        "weighted over bound",
        "weighted chi-square",
    ];
    let mut table = Table::new("noise-depth", caption, &header);
    for row in of(rows, "depth") {
        let light = row.get("light");
        table.row([
            format!("{}, {}, {light}", row.get("sensor"), row.get("scene")),
            row.get("turns").to_owned(),
            row.get("pixels").to_owned(),
            figures(row.value("modulation_dn"), 3),
            figures(row.value("swing"), 3),
            figures(100.0 * row.value("found") / row.value("samples"), 3),
            figures(100.0 * row.value("gross") / row.value("valid"), 2),
            figures(100.0 * row.value("beyond_5_sigma"), 2),
            figures(row.value("bound_mm"), 3),
            figures(row.value("spread_mm"), 3),
            figures(row.value("sigma_mm"), 3),
            figures(row.value("ratio"), 3),
            figures(row.value("chi_square"), 3),
            figures(row.value("bias_mm"), 2),
            figures(row.value("weighted_ratio"), 3),
            figures(row.value("weighted_chi_square"), 3),
        ]);
    }
    table
}

/// Tabulates the decoding time with and without weights.
pub(super) fn time(rows: &Rows) -> Table {
    let caption = "Median times to decode 12 steps, 8 Gray bits, white and black to coordinates";
    let header = [
        "pixels",
        "least squares, ms",
        "weighted, ms",
        "extra time, %",
    ];
    let mut table = Table::new("noise-time", caption, &header).timed();
    for row in of(rows, "time") {
        let (plain, weighted) = (row.value("plain_s"), row.value("weighted_s"));
        table.row([
            row.get("samples").to_owned(),
            figures(1e3 * plain, 3),
            figures(1e3 * weighted, 3),
            figures(100.0 * (weighted / plain - 1.0), 2),
        ]);
    }
    table
}
