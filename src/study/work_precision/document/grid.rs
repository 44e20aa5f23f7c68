//! What holds on any machine: errors by steps and resolution, and the least work for an accuracy,
//! counted in pixels that are exposed and read.

use super::um;
use phasmid_report::lab::{Row, Table};
use phasmid_report::plot::figures;

/// Settings by their steps and their resolution, one sample a pixel.
pub(super) fn by_steps(scans: &[&Row]) -> Table {
    let single = || scans.iter().filter(|row| row.get("samples") == "1");
    let distinct = |name: &str| {
        let mut found: Vec<&str> = Vec::new();
        for row in single() {
            if !found.contains(&row.get(name)) {
                found.push(row.get(name));
            }
        }
        found
    };
    let (steps, scales) = (distinct("steps"), distinct("scale"));
    let size = |scale: &&str| {
        let row = single().find(|row| row.get("scale") == *scale);
        row.map_or_else(String::new, |row| {
            format!("{} x {}", row.get("width"), row.get("height"))
        })
    };
    let header: Vec<String> = std::iter::once("steps".to_owned())
        .chain(scales.iter().map(size))
        .collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = Table::new(
        "work-precision-steps",
        "Inlier RMSE in micrometres of the same field by steps and pixels.",
        &header,
    );
    for steps in &steps {
        let cells = scales.iter().map(|scale| {
            let same = |row: &&&Row| row.get("steps") == *steps && row.get("scale") == *scale;
            let row = single().find(same);
            row.map_or_else(String::new, |row| um(row.value("inlier_rmse_mm")))
        });
        table.row(std::iter::once((*steps).to_owned()).chain(cells));
    }
    table
}

/// Megapixels of all frames of a scan.
fn megapixels(row: &Row) -> f64 {
    row.value("frames") * row.value("width") * row.value("height") * 1e-6
}

/// For each wanted accuracy the setting of the fewest pixels, and of those the fewest frames, that
/// `fits`.
pub(super) fn least_work(
    scans: &[&Row],
    wanted_mm: &[f64],
    caption: String,
    fits: impl Fn(&Row, f64) -> bool,
) -> Table {
    let mut table = Table::new(
        "work-precision-least",
        caption,
        &[
            "wanted, mm",
            "steps",
            "pixels",
            "frames",
            "Mpixel in all",
            "inlier RMSE, um",
        ],
    );
    for &wanted in wanted_mm {
        // More samples a pixel are more work for the same pixels.
        let fitting = scans
            .iter()
            .filter(|row| row.get("samples") == "1" && fits(row, wanted));
        let work = |row: &&&Row| [megapixels(row), row.value("frames")];
        let least = fitting.min_by(|a, b| {
            let ([a, m], [b, n]) = (work(a), work(b));
            a.total_cmp(&b).then(m.total_cmp(&n))
        });
        let cells = match least {
            Some(row) => [
                row.get("steps").to_owned(),
                format!("{} x {}", row.get("width"), row.get("height")),
                row.get("frames").to_owned(),
                figures(megapixels(row), 3),
                um(row.value("inlier_rmse_mm")),
            ],
            None => ["none", "", "", "", ""].map(str::to_owned),
        };
        table.row(std::iter::once(wanted.to_string()).chain(cells));
    }
    table
}
