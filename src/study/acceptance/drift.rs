//! Drift and noise during an hour of scans of a still patient: the light fades, the pods warm up,
//! and the sensors are noisy.

use super::answer::{DEVIATIONS, ERRORS, answered, part, rms, shift_mm, track, worst};
use super::effort::Effort;
use super::subject::{Body, Subject};
use crate::clinic::Pods;
use phasmid_core::error::Result;
use phasmid_decode::Decoded;
use phasmid_profile::{Droop, Led, Profile};
use phasmid_report::lab::{
    Block, Chart, Check, Context, Figure, Row, Rows, Section, Series, SeriesStyle, Settings, Table,
    Trial,
};
use phasmid_sgrt::{POINTS, Region, SixDof, six};

/// Text above the tables.
const WORDS: &str = "Fading light reduces the modulation of the fringes but does not shift their \
    phase. Heat does move a scanner in a clinic: as an example, the aluminium beam between camera \
    and projector of each pod warms by 5 K and expands, which the calibration does not know. Both \
    effects and their speeds are assumptions.";

/// Spread of a pixel's repeated scans, in millimetres, above which the pixel is a gross error.
const GROSS_MM: f64 = phasmid_measure::GROSS_MM;
/// A projector's LED: junction, board and heat sink together cost a quarter of its light. The values
/// are assumptions; data sheets of high-power green LEDs state 10 to 30 % at a junction temperature of
/// 85 degrees.
const RISE_US: f64 = 5.0;
const DROOPS: [(f64, f64); 3] = [(0.3, 0.05), (60.0, 0.08), (900.0, 0.12)];
/// Final temperature rise of a pod and its time constant (assumptions for electronics in a closed
/// case), then the expansion of its aluminium beam per kelvin.
const WARMER_K: f64 = 5.0;
const WARMING_S: f64 = 900.0;
const GROWTH_PER_K: f64 = 23e-6;
/// Cases and their labels.
const CASES: [(&str, &str); 2] = [
    ("light", "light fades"),
    ("heat", "light fades, beams grow"),
];

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    vec![
        Trial::new("drift/light", settings.seed, move |context| {
            faded(context, effort)
        }),
        Trial::new("drift/heat", settings.seed, move |context| {
            warmed(context, effort)
        }),
    ]
}

/// Gives the pods' profile a fading light source.
fn fading(profile: &mut Profile, effort: Effort) {
    effort.adapt(profile);
    let droop = DROOPS.map(|(time_constant_s, fraction)| Droop {
        time_constant_s,
        fraction,
    });
    profile.projector.led = Some(Led {
        rise_us: RISE_US,
        droop: droop.into(),
    });
}

/// Returns the relative elongation of the beam between camera and projector at a time.
fn growth(time_s: f64) -> f64 {
    GROWTH_PER_K * WARMER_K * (1.0 - (-time_s / WARMING_S).exp())
}

fn row(case: &str, time_s: f64) -> Row {
    Row::new()
        .text("subject", "patient")
        .text("case", case)
        .number("time_s", time_s)
}

/// Scans several times during the hour, then repeatedly at its end.
fn faded(context: &Context<'_>, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(Body::Patient(None))?;
    let reference = subject.reference()?;
    let mut pods = Pods::new(&subject.scene, context.seed, &|profile| {
        fading(profile, effort);
    })?;
    let still = SixDof::default();
    let mut rows = Vec::new();
    let mut end_s = 0.0;
    for &time_s in effort.hour_s {
        let scan = pods.scan((time_s * 1e9) as u64, false)?;
        let fit = track(&pods.measured(&scan, POINTS), &reference);
        let row = row("light", time_s).number("modulation_dn", modulation(&scan));
        rows.push(answered(row, None, &fit, &still));
        end_s = time_s;
    }
    let mut noise = Noise::default();
    for k in 1..=effort.repeats {
        let time_s = end_s + k as f64;
        let scan = pods.scan((time_s * 1e9) as u64, false)?;
        let fit = track(&pods.measured(&scan, POINTS), &reference);
        rows.push(answered(row("repeat", time_s), None, &fit, &still));
        noise.add(&pods, &scan);
    }
    rows.push(noise.row(row("noise", end_s)));
    Ok(rows)
}

/// Like [`faded`], with pods whose beams have grown since their calibration. Each scan time needs its
/// own pods, because their rigs differ.
fn warmed(context: &Context<'_>, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(Body::Patient(None))?;
    let reference = subject.reference()?;
    let calibrated = {
        let mut profile = Profile::load("sgrt-pod")?;
        fading(&mut profile, effort);
        profile.nominal_rig()
    };
    let mut rows = Vec::new();
    for &time_s in effort.heat_s {
        let mut pods = Pods::new(&subject.scene, context.seed, &|profile| {
            fading(profile, effort);
            for along in &mut profile.projector.position_mm {
                *along *= 1.0 + growth(time_s);
            }
        })?;
        for pod in &mut pods.all {
            pod.calibrated(&calibrated)?;
        }
        let scan = pods.scan((time_s * 1e9) as u64, false)?;
        let fit = track(&pods.measured(&scan, POINTS), &reference);
        let row = row("heat", time_s).number("modulation_dn", modulation(&scan));
        rows.push(answered(row, None, &fit, &SixDof::default()));
    }
    Ok(rows)
}

/// Returns the mean modulation of the fringes, in grey levels, over the pixels that have a point.
fn modulation(scan: &[Decoded]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for decoded in scan {
        let pixels = decoded.depth.iter().zip(&decoded.modulation);
        for (_, modulation) in pixels.filter(|(depth, _)| !depth.is_nan()) {
            sum += f64::from(*modulation);
            count += 1.0;
        }
    }
    sum / count
}

/// Depths of repeated scans, for each pixel of each pod.
#[derive(Default)]
struct Noise {
    scans: u32,
    pixels: Vec<Vec<Pixel>>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Pixel {
    /// Number of scans in which the pixel has a depth and its point lies in the region.
    count: u32,
    /// The first depth, which is subtracted from the others to keep their precision.
    first: f64,
    sum: f64,
    squares: f64,
    /// Sum of the variances predicted by the decoder.
    predicted: f64,
}

impl Noise {
    fn add(&mut self, pods: &Pods, scan: &[Decoded]) {
        self.pixels.resize(scan.len(), Vec::new());
        let [lo, hi] = Region::CHEST;
        for ((pod, decoded), pixels) in pods.all.iter().zip(scan).zip(&mut self.pixels) {
            pixels.resize(decoded.depth.len(), Pixel::default());
            let depths = decoded.depth.iter().zip(&decoded.depth_sigma);
            for (i, ((depth, sigma), pixel)) in depths.zip(pixels).enumerate() {
                let depth = f64::from(*depth);
                if depth.is_nan() {
                    continue;
                }
                let place = pod.place(i, depth);
                if place.cmpge(lo).all() && place.cmple(hi).all() {
                    pixel.add(depth, f64::from(*sigma));
                }
            }
        }
        self.scans += 1;
    }

    /// Adds the noise, pooled over the pixels that have a point in all scans, to a row.
    fn row(&self, row: Row) -> Row {
        let all = self.pixels.iter().flatten();
        let whole: Vec<&Pixel> = all.filter(|pixel| pixel.count == self.scans).collect();
        let inlier = |pixel: &&&Pixel| pixel.variance() <= GROSS_MM * GROSS_MM;
        let inliers: Vec<&&Pixel> = whole.iter().filter(inlier).collect();
        let mean = |of: &dyn Fn(&Pixel) -> f64| {
            inliers.iter().map(|pixel| of(pixel)).sum::<f64>() / inliers.len() as f64
        };
        let scans = f64::from(self.scans);
        row.number("points", whole.len() as f64)
            .number("noise_mm", mean(&Pixel::variance).sqrt())
            .number("predicted_mm", mean(&|p| p.predicted / scans).sqrt())
            .number("gross", 1.0 - inliers.len() as f64 / whole.len() as f64)
    }
}

impl Pixel {
    fn add(&mut self, depth: f64, sigma: f64) {
        if self.count == 0 {
            self.first = depth;
        }
        let off = depth - self.first;
        self.count += 1;
        self.sum += off;
        self.squares += off * off;
        self.predicted += sigma * sigma;
    }

    /// Returns the unbiased variance of the pixel's depths.
    fn variance(&self) -> f64 {
        let n = f64::from(self.count);
        (self.squares - self.sum * self.sum / n).max(0.0) / (n - 1.0)
    }
}

fn of<'a>(rows: &'a Rows, case: &'a str) -> Vec<&'a Row> {
    let all = part(rows, "drift");
    all.filter(|row| row.get("case") == case).collect()
}

/// Returns the change of the tracked pose since the first scan, in millimetres and degrees (largest
/// angle).
fn gone(row: &Row, first: &Row) -> [f64; 2] {
    let off: [f64; 6] = std::array::from_fn(|k| row.value(ERRORS[k]) - first.value(ERRORS[k]));
    let place = rms(off[..3].iter().copied()) * 3f64.sqrt();
    [place, worst(off[3..].iter().map(|angle| angle.abs()))]
}

/// Returns the largest drift of a case over the hour, in millimetres and degrees; NaN without rows.
pub(super) fn largest(rows: &Rows, case: &str) -> [f64; 2] {
    let all = of(rows, case);
    [0, 1].map(|k| worst(all.iter().map(|row| gone(row, all[0])[k])))
}

/// Returns three RMS noises in millimetres over repeated scans: measured for the tracked position
/// (length of the vector), measured for the pixels' depths, and predicted for these depths by the
/// decoder.
pub(super) fn noise(rows: &Rows) -> [f64; 3] {
    let repeats = of(rows, "repeat");
    let of_place = (0..3).map(|k| spread(&repeats, k));
    let place = rms(of_place) * 3f64.sqrt();
    let pixels = of(rows, "noise");
    let of_pixels = |name: &str| pixels.first().map_or(f64::NAN, |row| row.value(name));
    [place, of_pixels("noise_mm"), of_pixels("predicted_mm")]
}

/// Returns the standard deviation of column `k` of [`ERRORS`] over some scans.
fn spread(rows: &[&Row], k: usize) -> f64 {
    if rows.len() < 2 {
        return f64::NAN;
    }
    let n = rows.len() as f64;
    let values = rows.iter().map(|row| row.value(ERRORS[k]));
    let mean = values.clone().sum::<f64>() / n;
    (values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut blocks = vec![Block::Words(WORDS.to_owned())];
    if !of(rows, "light").is_empty() {
        blocks.extend([
            Block::Table(hour(rows)),
            Block::Figure(figure(rows)),
            Block::Table(still(rows)),
            Block::Checks(checks(rows)),
        ]);
    }
    Section::new("Drift over an hour", blocks)
}

fn hour(rows: &Rows) -> Table {
    let mut table = Table::new(
        "acceptance-drift",
        "A still patient over an hour of device time, in which the light fades and, in the second \
         half of the table, the beam between camera and projector of each pod also expands: \
         modulation of the fringes (grey levels), and change of the position (mm) and of the \
         angles (largest of the three, degrees) since the first scan.",
        &["case, time", "modulation", "position", "angles"],
    );
    for (case, name) in CASES {
        let all = of(rows, case);
        for row in &all {
            let [place, angle] = gone(row, all[0]);
            table.row([
                format!("{name}, {} s", row.get("time_s")),
                format!("{:.2}", row.value("modulation_dn")),
                format!("{place:.3}"),
                format!("{angle:.4}"),
            ]);
        }
    }
    table
}

/// Tabulates the repeated scans at the end of the hour.
fn still(rows: &Rows) -> Table {
    let repeats = of(rows, "repeat");
    let mut table = Table::new(
        "acceptance-noise",
        format!(
            "Noise of {} consecutive scans of the still patient at the end of the hour: standard \
             deviation of the tracked values and the one that the tracker predicts, and of the \
             depths of single pixels (RMS over the pixels with a point in all scans and no gross \
             error) and the one that the decoder predicts.",
            repeats.len()
        ),
        &["of", "found", "predicted"],
    );
    for k in 0..6 {
        let unit = if k < 3 { "mm" } else { "deg" };
        let predicted = rms(repeats.iter().map(|row| row.value(DEVIATIONS[k])));
        table.row([
            format!("{} ({unit})", six::NAMES[k]),
            format!("{:.4}", spread(&repeats, k)),
            format!("{predicted:.4}"),
        ]);
    }
    let [_, found, predicted] = noise(rows);
    table.row([
        "depth of a pixel (mm)".to_owned(),
        format!("{found:.3}"),
        format!("{predicted:.3}"),
    ]);
    table
}

fn figure(rows: &Rows) -> Figure {
    let series = CASES.map(|(case, name)| {
        let all = of(rows, case);
        let points = all
            .iter()
            .map(|row| (row.value("time_s") / 60.0, gone(row, all[0])[0]));
        Series::new(name, SeriesStyle::Both, points)
    });
    let chart = Chart {
        heading: "Drift of a still patient".to_owned(),
        x: "device time (min)".to_owned(),
        y: "change of the tracked position (mm)".to_owned(),
        log: [false, false],
        series: series.into(),
    };
    chart.figure(
        "acceptance-drift",
        "Change of the tracked position of a still patient since the first scan.",
    )
}

fn checks(rows: &Rows) -> Vec<Check> {
    let mut checks = vec![Check::at_most(
        "drift of the tracked position over an hour of fading light, in mm",
        largest(rows, "light")[0],
        super::known::BAR[0],
    )];
    let heat = of(rows, "heat");
    checks.push(Check::at_most(
        "position error with pods 5 K warmer than at calibration, in mm",
        worst(heat.into_iter().map(shift_mm)),
        super::known::TOLERANCE[0],
    ));
    checks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_of_pixels_is_that_of_their_depths() {
        let mut pixel = Pixel::default();
        for depth in [2400.1, 2400.3, 2400.2] {
            pixel.add(depth, 0.3);
        }
        assert!((pixel.variance() - 0.01).abs() < 1e-9);
        assert!((pixel.predicted / 3.0 - 0.09).abs() < 1e-12);
    }

    #[test]
    fn beams_grow_towards_their_end() {
        assert_eq!(growth(0.0), 0.0);
        // A beam of 550 mm grows by 63 um at 5 K.
        assert!((growth(1e9) * 550.0 - 0.06325).abs() < 1e-9);
    }
}
