//! Complete scans of several devices: cost and benefit of each knob of [`crate::tradeoff`].

use crate::tradeoff::{Measured, Setting, cheapest, front, measure, settings};
use phasmid_core::error::{Error, Result};
use phasmid_profile::{Configuration, Interreflection, Profile, Scene};
use phasmid_report::lab::{
    Block, Chart, Check, Context, Row, Rows, Section, Series, SeriesStyle, Settings, Table, Trial,
};
use phasmid_report::plot::figures;

/// The ceiling-mounted pods.
const POD: &str = "sgrt-ceiling";
/// A random device from `tests/studies/zoo`, for which no parameter was tuned.
const ZOO: &str = "zoo-20";
/// The devices, each with its scene.
const DEVICES: [(&str, &str); 4] = [
    // This scene has indirect light.
    ("pmp-bench", "trapezoid"),
    ("webcam-grey", "sphere"),
    (POD, "treatment-room"),
    (ZOO, "zoo"),
];
/// Accuracies for which the fastest setting is named.
const WANTED_MM: [f64; 4] = [0.5, 0.2, 0.1, 0.05];
/// Fraction of the field per side in the quick form.
const QUICK: f64 = 0.4;

/// The devices of the quick form.
const QUICK_DEVICES: [&str; 2] = ["webcam-grey", ZOO];
/// Maximum ratio of the noise bound to the error: an error far below the bound would be a mistake.
const ABOVE_ERROR: f64 = 1.05;

/// A trial for each device.
pub fn trials(settings: &Settings) -> Vec<Trial> {
    let trial = |(device, scene): (&'static str, &'static str)| {
        let key = format!("device/{device}");
        Trial::new(key, settings.seed, move |context| {
            run(context, device, scene)
        })
        .alone()
    };
    let wanted = |(device, _): &(&str, &str)| !settings.quick || QUICK_DEVICES.contains(device);
    DEVICES.into_iter().filter(wanted).map(trial).collect()
}

fn load(device: &str, scene: &str) -> Result<(Profile, Scene)> {
    Ok(match device {
        ZOO => (
            Profile::parse(include_str!("zoo-20.toml"), "zoo-20.toml")?,
            Scene::parse(include_str!("zoo-20-scene.toml"), "zoo-20-scene.toml")?,
        ),
        POD => {
            let Configuration::Station(station) = Configuration::load(POD)? else {
                return Err(Error::input(POD, "a device", "a station"));
            };
            let (pod, mut scene) = (&station.device[0], Scene::load(scene)?);
            scene.rig = pod.rig().unwrap_or(scene.rig);
            (Profile::load(&station.profile(pod))?, scene)
        }
        _ => {
            let mut scene = Scene::load(scene)?;
            if device == "pmp-bench" {
                scene.interreflection = Some(Interreflection {
                    samples: Some(64),
                    ..Interreflection::default()
                });
            }
            (Profile::load(device)?, scene)
        }
    })
}

fn run(context: &Context<'_>, device: &str, scene: &str) -> Result<Vec<Row>> {
    let (mut profile, scene) = load(device, scene)?;
    let mut wanted = settings(&profile, &scene);
    let mut rounds = (5, 1.0);
    if context.settings.quick {
        // Keep the middle of the field, with pixels of unchanged size.
        let camera = &mut profile.camera;
        camera.sensor_width_mm *= QUICK;
        [camera.width_px, camera.height_px] =
            [camera.width_px, camera.height_px].map(|px| (f64::from(px) * QUICK) as u32);
        // Keep one setting for each combination of knobs, and time it once.
        wanted = once(&wanted);
        rounds = (1, 0.0);
    }
    let mut rows = Vec::new();
    for setting in &wanted {
        let row = Row::new()
            .text("group", "device")
            .text("setting", &setting.to_string());
        let row = row.text("device", device);
        let watch = context.stopwatch();
        rows.push(
            match measure((&profile, &scene), setting, context.seed, watch, rounds) {
                Ok(found) => row
                    .number("width", f64::from(found.size_px[0]))
                    .number("height", f64::from(found.size_px[1]))
                    .number("frames", found.frames as f64)
                    .number("inlier_rmse_mm", found.rmse_mm)
                    .number("bound_mm", found.bound_mm)
                    .number("gross", found.gross_error_rate)
                    .number("coverage", found.coverage)
                    .number("render_s", found.render_ms * 1e-3)
                    .number("decode_s", found.decode_ms * 1e-3),
                Err(e) => row.text("note", &e.to_string()),
            },
        );
    }
    Ok(rows)
}

/// Returns the first setting of each combination of knobs.
fn once(all: &[Setting]) -> Vec<Setting> {
    let knobs = |s: &Setting| {
        [
            s.sequence.is_some(),
            s.steps.is_some(),
            s.period.is_some(),
            s.scale.is_some(),
            s.samples.is_some(),
            s.time_samples.is_some(),
            s.interreflection.is_some(),
            s.gpu,
            s.weighted,
        ]
    };
    let mut kept: Vec<Setting> = Vec::new();
    for setting in all {
        if !setting.gpu && !kept.iter().any(|other| knobs(other) == knobs(setting)) {
            kept.push(setting.clone());
        }
    }
    kept
}

/// Returns the measurements of a row.
fn measured(row: &Row) -> Measured {
    Measured {
        setting: Setting::default(),
        size_px: ["width", "height"].map(|name| row.value(name) as u32),
        frames: row.value("frames") as usize,
        render_ms: row.value("render_s") * 1e3,
        decode_ms: row.value("decode_s") * 1e3,
        rmse_mm: row.value("inlier_rmse_mm"),
        bound_mm: row.value("bound_mm"),
        gross_error_rate: row.value("gross"),
        coverage: row.value("coverage"),
    }
}

/// Returns the document's section for these rows.
pub fn section(rows: &Rows) -> Section {
    let about = "Four devices, each in front of one scene: the profile's own setting, numbers of \
        phase steps at each resolution, and each other knob changed alone. Fewer pixels are larger \
        pixels over the same field, so each has more light and less noise. The time is for \
        rendering a scan with its geometry and decoding it. `phasmid plan --accuracy` makes this \
        table for any device and scene.";
    let mut blocks = vec![Block::Words(about.to_owned())];
    let mut chosen = Table::new(
        "work-precision-chosen",
        "The fastest setting for a wanted RMS error.",
        &["device", "wanted, mm", "setting", "RMSE, um", "time, ms"],
    )
    .timed();
    let mut checks = Vec::new();
    for (device, scene) in DEVICES {
        let of: Vec<&Row> = rows.with("device", device).collect();
        if of.is_empty() {
            continue;
        }
        let all: Vec<Measured> = of.iter().map(|row| measured(row)).collect();
        blocks.push(Block::Table(errors(device, scene, &of, &all).detail()));
        blocks.push(Block::Table(times(device, &of, &all).detail()));
        blocks.push(Block::Figure(chart(device, &of, &all).figure(
            &format!("work-precision-{device}"),
            format!(
                "{device} before {scene}: error against time. Rings are settings with more than 1 % \
                 of gross errors or less than 90 % of the surface."
            ),
        )));
        for wanted in WANTED_MM {
            let best = cheapest(&all, wanted).and_then(|best| all.iter().position(|m| m == best));
            let cells = match best {
                Some(i) => [
                    of[i].get("setting").to_owned(),
                    figures(all[i].rmse_mm * 1e3, 3),
                    figures(all[i].total_ms(), 3),
                ],
                None => ["none", "", ""].map(str::to_owned),
            };
            chosen.row(
                [device.to_owned(), wanted.to_string()]
                    .into_iter()
                    .chain(cells),
            );
        }
        let failed = of.iter().filter(|row| !row.get("note").is_empty()).count();
        checks.push(Check::at_most(
            format!("{device}: settings that cannot be measured"),
            failed as f64,
            0.0,
        ));
        // Exclude weighted steps: they can go below the bound, which is that of least squares.
        let plain = of
            .iter()
            .zip(&all)
            .filter(|(row, m)| m.is_sound() && row.get("setting") != "weighted");
        let over = plain
            .map(|(_, m)| m.bound_mm / m.rmse_mm)
            .fold(f64::NAN, f64::max);
        checks.push(Check::at_most(
            format!("{device}: largest ratio of bound to error of a sound setting"),
            over,
            ABOVE_ERROR,
        ));
    }
    blocks.push(Block::Table(chosen));
    blocks.push(Block::Checks(checks));
    Section::new("Devices", blocks)
}

/// Tabulates errors without the GPU, which not every machine has.
fn errors(device: &str, scene: &str, rows: &[&Row], all: &[Measured]) -> Table {
    let mut table = Table::new(
        &format!("work-precision-{device}"),
        format!("{device} before {scene}: depth error of the inliers on smooth surfaces."),
        &[
            "setting",
            "pixels",
            "frames",
            "RMSE, um",
            "bound, um",
            "gross, %",
            "coverage, %",
        ],
    );
    for (row, m) in rows.iter().zip(all) {
        if row.get("setting") == "GPU" {
            continue;
        }
        table.row([
            row.get("setting").to_owned(),
            format!("{} x {}", m.size_px[0], m.size_px[1]),
            m.frames.to_string(),
            figures(m.rmse_mm * 1e3, 3),
            figures(m.bound_mm * 1e3, 3),
            percent(m.gross_error_rate, 2),
            percent(m.coverage, 1),
        ]);
    }
    table
}

fn percent(part: f64, decimals: usize) -> String {
    match part.is_finite() {
        true => format!("{:.decimals$}", 100.0 * part),
        false => "-".to_owned(),
    }
}

fn times(device: &str, rows: &[&Row], all: &[Measured]) -> Table {
    let mut table = Table::new(
        &format!("work-precision-{device}-times"),
        format!(
            "{device}: time per scan in milliseconds. No other setting is both faster and more \
            accurate than one on the front."
        ),
        &["setting", "render", "decode", "sum", "RMSE, um", "front"],
    )
    .timed();
    for ((row, m), front) in rows.iter().zip(all).zip(front(all)) {
        table.row([
            row.get("setting").to_owned(),
            figures(m.render_ms, 3),
            figures(m.decode_ms, 3),
            figures(m.total_ms(), 3),
            figures(m.rmse_mm * 1e3, 3),
            if front { "*" } else { "" }.to_owned(),
        ]);
    }
    table
}

fn chart(device: &str, rows: &[&Row], all: &[Measured]) -> Chart {
    let named = |name: &str, style, keep: &dyn Fn(usize) -> bool| {
        let kept: Vec<usize> = (0..all.len()).filter(|&i| keep(i)).collect();
        let points = kept.iter().map(|&i| (all[i].total_ms(), all[i].rmse_mm));
        let mut series = Series::new(name, style, points);
        series.tips = kept
            .iter()
            .map(|&i| rows[i].get("setting").to_owned())
            .collect();
        series
    };
    let on = front(all);
    let steps = |i: usize| rows[i].get("setting").contains("steps");
    let mut line = named("front", SeriesStyle::Dashed, &|i| on[i]);
    line.points.sort_by(|a, b| a.x.total_cmp(&b.x));
    line.labelled = false;
    Chart {
        heading: device.to_owned(),
        x: "time to render and decode a scan, ms".to_owned(),
        y: "inlier RMSE, mm".to_owned(),
        log: [true; 2],
        series: vec![
            named("steps and resolution", SeriesStyle::Dots, &|i| {
                steps(i) && all[i].is_sound()
            }),
            named("other knobs", SeriesStyle::Dots, &|i| {
                !steps(i) && all[i].is_sound()
            }),
            line,
            named("excluded", SeriesStyle::Rings, &|i| !all[i].is_sound()),
        ],
    }
}
