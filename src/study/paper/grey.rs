//! Grey profiles along one line at each distance.

use super::bench::{DIMMED, around_trapezoid, bench, surface, trapezoid};
use super::figures::{Target, of, three};
use super::published::DISTANCES;
use super::scan::Scan;
use phasmid_core::error::{Error, Result};
use phasmid_report::lab::{
    Block, Chart, Context, Folder, Row, Rows, Section, Series, SeriesStyle, Settings, Table, Trial,
};

/// Columns shown in the chart on either side of the middle: four fringes, because five longer curves
/// would not be distinguishable.
const SHOWN: usize = 8;

/// Returns one trial per distance.
pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let one = |(distance, _)| {
        let key = format!("grey/L={distance}");
        Trial::new(key, settings.seed, move |context| at(context, distance))
    };
    DISTANCES.into_iter().map(one).collect()
}

/// Writes the middle row of the first frame to a file; the returned row has the mean and the modulation
/// on the top.
fn at(context: &Context<'_>, distance: f64) -> Result<Vec<Row>> {
    let profile = bench(DIMMED, around_trapezoid(context.settings.quick))?;
    let scene = trapezoid(distance)?;
    let scan = Scan::new(&profile, &scene, context.seed)?;
    let (width, height) = scan.size();
    let line = &scan.frame(0)?[height / 2 * width..][..width];
    let text: String = line.iter().map(|level| format!("{level}\n")).collect();
    context.folder.leave(&file(distance), text.as_bytes())?;

    let target = Target::new(&surface(&scene)?, scan.rig(), &scan.truth);
    let top = |&&i: &&usize| (distance - 80.0 - f64::from(scan.truth.depth_mm[i])).abs() < 0.01;
    let (mut mean, mut modulation, mut count) = (0.0, 0.0, 0.0);
    for &i in target.on.iter().filter(top) {
        mean += f64::from(scan.truth.mean_dn[i]);
        modulation += f64::from(scan.truth.modulation_dn[i]);
        count += 1.0;
    }
    Ok(vec![
        Row::new()
            .number("distance_mm", distance)
            .number("grey_dn", mean / count)
            .number("modulation_dn", modulation / count),
    ])
}

fn file(distance: f64) -> String {
    format!("grey-{distance}.txt")
}

/// Returns a chart and a table.
pub(super) fn section(rows: &Rows, folder: &Folder) -> Result<Section> {
    let mut table = Table::new(
        "paper-grey",
        "Top of the trapezoid under fringes, without noise: mean grey level, modulation in grey \
         levels, and contrast, which is the modulation divided by the mean above the black level \
         of 4.",
        &["L in mm", "mean", "modulation", "contrast"],
    );
    let mut series = Vec::new();
    for (distance, _) in DISTANCES {
        let row = of(rows, "grey/").find(|row| row.value("distance_mm") == distance);
        let value = |column| row.map_or(f64::NAN, |row| row.value(column));
        let (mean, modulation) = (value("grey_dn"), value("modulation_dn"));
        table.row([
            format!("{distance}"),
            three(mean),
            three(modulation),
            three(modulation / (mean - 4.0)),
        ]);
        let levels = levels(folder, &file(distance))?;
        let middle = levels.len() / 2;
        let shown = levels.iter().enumerate().map(|(u, level)| {
            let u = u as f64 - (levels.len() as f64 - 1.0) / 2.0;
            (u, *level)
        });
        let shown = shown
            .skip(middle.saturating_sub(SHOWN))
            .take(2 * SHOWN)
            .collect::<Vec<_>>();
        series.push(Series::new(
            &format!("{distance} mm"),
            SeriesStyle::Both,
            shown,
        ));
    }
    let chart = Chart {
        heading: "Grey levels along the middle row".to_owned(),
        x: "column from the middle in px".to_owned(),
        y: "grey level".to_owned(),
        log: [false, false],
        series,
    };
    let figure = chart.figure(
        "paper-grey",
        "Grey levels across the top of the trapezoid in the first frame at each distance",
    );
    Ok(Section::new(
        "Grey profiles",
        vec![
            Block::Words(WORDS.to_owned()),
            Block::Figure(figure),
            Block::Table(table),
        ],
    ))
}

fn levels(folder: &Folder, name: &str) -> Result<Vec<f64>> {
    let bytes = folder.left(name)?;
    let text = String::from_utf8_lossy(&bytes);
    let level = |line: &str| {
        line.parse()
            .map_err(|_| Error::input(name, line, "grey levels, one per line"))
    };
    text.lines().map(level).collect()
}

const WORDS: &str = "The light is the same at all distances, 0.7 of the bench's own. A fringe is \
    3.68 px wide in the image at any distance, because both pupils stand side by side; its \
    position, its light and, away from 1000 mm, its contrast change with the distance. The pixel's \
    own width leaves 0.88 of the contrast, and ambient light takes some of it everywhere. The \
    projector's blur, a disc that at 800 mm is 5.4 of its pixels wide on the top of the trapezoid, \
    takes 13 % there.";
