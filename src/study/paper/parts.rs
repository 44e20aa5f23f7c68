//! Parts of the trapezoid: rim and centre above a height of 70 mm, and the foot below 20 mm.

use super::bench::{around_trapezoid, bench, of_object, surface, trapezoid};
use super::figures::{Target, of, percent, three};
use super::formula::TOP_MM;
use super::published::PARTS;
use super::scan::Scan;
use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_measure::Directed;
use phasmid_render::truth::Truth;
use phasmid_report::lab::{Block, Context, Row, Rows, Section, Settings, Table, Trial};

/// Heights in mm at which the trapezoid is cut.
const CUTS_MM: [f64; 2] = [20.0, 70.0];
/// Half width in mm of the centre: the inner half of the part above the upper cut.
const CENTRE_MM: f64 = TOP_MM / 4.0;

const NAMES: [&str; 3] = ["rim", "centre", "foot"];

/// Returns one trial.
pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    vec![Trial::new("parts", settings.seed, parts)]
}

fn parts(context: &Context<'_>) -> Result<Vec<Row>> {
    let profile = bench(1.0, around_trapezoid(context.settings.quick))?;
    let scene = trapezoid(1000.0)?;
    let scan = Scan::new(&profile, &scene, context.seed)?;
    let target = Target::new(&surface(&scene)?, scan.rig(), &scan.truth);
    let own = of_object(&scene);
    let (depth, truth) = (&scan.decoded.depth, &scan.truth);
    let of_part = |name: &&str| {
        let in_part = |&&i: &&usize| {
            let true_point = target.point(i, truth.depth_mm[i]);
            part(own.point(true_point)).is_some_and(|part| part == *name)
        };
        let errors = |crease: bool| {
            let of_kind = |i: &&usize| (truth.flags[**i] & Truth::CREASE != 0) == crease;
            let all = target.on.iter().filter(in_part).filter(of_kind);
            let errors = all.map(|&i| f64::from(depth[i] - truth.depth_mm[i]).abs());
            errors.filter(|e| e.is_finite()).collect::<Vec<_>>()
        };
        let row = Row::new().text("case", name);
        let smooth = errors(false);
        let rmse = Directed::of(smooth.clone()).map_or(f64::NAN, |d| d.inlier_rmse_mm);
        let all = Directed::of([smooth, errors(true)].concat());
        match all {
            Some(all) => row
                .number("points", all.points as f64)
                .number("mae_mm", all.mae_mm)
                .number("hd_surface_mm", all.hausdorff_mm)
                .number("gross", all.gross_error_rate)
                .number("inlier_rmse_mm", rmse),
            None => row.number("points", 0.0),
        }
    };
    Ok(NAMES.iter().map(of_part).collect())
}

/// Returns the part that contains a point of the trapezoid's own frame.
fn part(p: DVec3) -> Option<&'static str> {
    let height = -p.z;
    let aside = p.x.abs().max(p.y.abs());
    match height {
        _ if height < CUTS_MM[0] => Some(NAMES[2]),
        _ if height < CUTS_MM[1] => None,
        _ if aside < CENTRE_MM => Some(NAMES[1]),
        _ => Some(NAMES[0]),
    }
}

/// Returns a table.
pub(super) fn section(rows: &Rows) -> Section {
    let mut table = Table::new(
        "paper-parts",
        "Parts of the trapezoid at 1000 mm by triangulation, depth errors in mm. Smooth pixels see \
         one facet.",
        &[
            "part",
            "MAE, paper",
            "MAE, ours",
            "largest",
            "gross in %",
            "inlier RMSE, smooth pixels",
            "points",
        ],
    );
    for (name, paper) in NAMES.into_iter().zip(PARTS) {
        let row = of(rows, "parts").find(|row| row.get("case") == name);
        let value = |column| row.map_or(f64::NAN, |row| row.value(column));
        table.row([
            name.to_owned(),
            three(paper),
            three(value("mae_mm")),
            three(value("hd_surface_mm")),
            percent(value("gross")),
            three(value("inlier_rmse_mm")),
            format!("{}", value("points")),
        ]);
    }
    Section::new(
        "Parts",
        vec![Block::Words(WORDS.to_owned()), Block::Table(table)],
    )
}

const WORDS: &str = "The part that the paper cuts off at Z = 70 mm is taken to be the top (80 mm) \
    with the upper 10 mm of the sides; its centre is the inner 50 x 50 mm, and the rim is the rest \
    of it. The foot is everything below Z = 20 mm. The order of errors is the paper's: centre, \
    rim, foot. Ours has two reasons. Pixels at creases see a mixture of two facets, and the centre \
    has no creases. The foot consists only of sides, which lean away, one of them nearly along the \
    projector's rays.";

#[cfg(test)]
mod tests {
    use super::super::formula::{BASE_MM, HEIGHT_MM};
    use super::*;

    #[test]
    fn the_parts_are_cut_where_the_paper_says() {
        let at = |x: f64, y: f64, height: f64| part(DVec3::new(x, y, -height));
        assert_eq!(at(0.0, 0.0, HEIGHT_MM), Some("centre"));
        assert_eq!(at(40.0, 0.0, HEIGHT_MM), Some("rim"));
        assert_eq!(at(0.0, -55.0, 72.0), Some("rim"));
        assert_eq!(at(0.0, -65.0, 56.0), None);
        assert_eq!(at(BASE_MM / 2.0 - 5.0, 0.0, 8.0), Some("foot"));
    }
}
