//! The trapezoid at five distances, decoded by triangulation, and by the paper's height formula with its
//! fringe frequency f0 held or measured anew.

use super::bench::{DIMMED, around_trapezoid, bench, plane, surface, trapezoid};
use super::figures::{Target, of, percent, three};
use super::formula::{MEASURED_AT_MM, mean_over_base, mean_over_section, with_f0_held};
use super::published::DISTANCES;
use super::scan::{Scan, with_f0_of};
use phasmid_core::error::Result;
use phasmid_report::lab::{
    Block, Chart, Check, Context, Row, Rows, Section, Series, SeriesStyle, Settings, Table, Trial,
};
use phasmid_report::plot::figures;

const TRIANGULATION: &str = "triangulation";
const HELD: &str = "height, f0 held";
const ANEW: &str = "height, f0 anew";

/// Minimum ratio of the paper's errors at 1000 mm to ours.
const SMALLER: f64 = 10.0;
/// Maximum mean difference, in mm, of depths with f0 held from the closed form; the difference is the
/// noise of two scans.
const CLOSED_MM: f64 = 0.1;

/// Returns one trial per distance.
pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let one = |(distance, _)| {
        let key = format!("distance/L={distance}");
        Trial::new(key, settings.seed, move |context| at(context, distance))
    };
    DISTANCES.into_iter().map(one).collect()
}

/// Scans the trapezoid, the bare plane at the same distance, and the plane at 1000 mm, each with its
/// own noise seed.
fn at(context: &Context<'_>, distance: f64) -> Result<Vec<Row>> {
    let profile = bench(DIMMED, around_trapezoid(context.settings.quick))?;
    let scene = trapezoid(distance)?;
    let noise = context.seed.wrapping_mul(3);
    let scan = Scan::new(&profile, &scene, noise)?;
    let reference = |distance, seed| Scan::new(&profile, &plane(distance)?, seed)?.mapping();
    let anew = reference(distance, noise.wrapping_add(1))?;
    let known = reference(MEASURED_AT_MM, noise.wrapping_add(2))?;
    let held = with_f0_of(&anew, &known);
    let target = Target::new(&surface(&scene)?, scan.rig(), &scan.truth);

    let row = |method: &str, depth: &[f32], sigma: Option<&[f32]>, f0: f64| -> Result<Row> {
        let row = Row::new()
            .number("distance_mm", distance)
            .text("method", method)
            .number("f0_per_mm", f0);
        Ok(target.figures(depth, sigma, &scan.truth)?.row(row))
    };
    let by_held = scan.depths(&held)?;
    let decoded = &scan.decoded;
    let (closed, off) = closed_form(&target, &scan, &by_held, distance);
    Ok(vec![
        row(
            TRIANGULATION,
            &decoded.depth,
            Some(&decoded.depth_sigma),
            f64::NAN,
        )?,
        row(HELD, &by_held, None, held.constants.fringes_per_mm)?
            .number("closed_mm", closed)
            .number("closed_off_mm", off),
        row(
            ANEW,
            &scan.depths(&anew)?,
            None,
            anew.constants.fringes_per_mm,
        )?,
    ])
}

/// Returns two means over the measured pixels: the absolute error by the closed form, and the absolute
/// difference of the depths from the closed form.
fn closed_form(target: &Target, scan: &Scan, depth: &[f32], distance: f64) -> (f64, f64) {
    let (mut size, mut off, mut count) = (0.0, 0.0, 0.0);
    for &i in target.on.iter().filter(|&&i| depth[i].is_finite()) {
        let height = distance - f64::from(scan.truth.depth_mm[i]);
        let wanted = with_f0_held(height, distance);
        size += (wanted - height).abs();
        off += (distance - wanted - f64::from(depth[i])).abs();
        count += 1.0;
    }
    (size / count, off / count)
}

/// Returns tables, a chart and checks.
pub(super) fn section(rows: &Rows) -> Section {
    let blocks = vec![
        Block::Words(WORDS.to_owned()),
        Block::Table(means(rows)),
        Block::Figure(chart(rows).figure(
            "paper-distances",
            "Mean absolute error of the trapezoid over its distance",
        )),
        Block::Words(TREND.to_owned()),
        Block::Table(distances(rows)),
        Block::Words(FLOOR.to_owned()),
        Block::Table(apart(rows)),
        Block::Checks(checks(rows)),
    ];
    Section::new("Distances", blocks)
}

const WORDS: &str = "The trapezoid (200 mm base, 100 mm top, 80 mm high) stands on the reference \
    plane at distance L. Lenses are focused at 1000 mm. The light is the same at all distances, \
    0.7 of the bench's own: with all of it, the top would saturate at 800 mm. MAE is the mean \
    absolute depth error of all measured pixels of the trapezoid, including those at its creases; \
    CMAE is the same along the camera's middle row. f0 and the reference are measured on scans of \
    the bare plane, at L (anew) or at 1000 mm (held); L is known. The order of the paper's five \
    values, by increasing distance, is inferred from its text.";

const TREND: &str = "The paper's errors almost vanish at 1000 mm and grow on both sides of it, as \
    the formula's do with f0 held at its value for 1000 mm: 0.172 per mm is right only at 1000 mm, \
    because fringes widen with the distance. The closed form has no free parameter: over the \
    frustum it is 10.5, 4.8, 0, 4.0 and 7.4 mm. At 1100 and 1200 mm this agrees with the paper's \
    column within 0.4 mm; at 900 mm it is 1.1 mm and at 800 mm 3.3 mm larger. The paper's column \
    is nearly symmetric about 1000 mm, the closed form is not. Holding f0 thus explains the size \
    and the growth on both sides, but at short distances something in the paper compensates a part \
    of the error. Our error over pixels is larger than that by area, because nearer parts fill \
    more pixels. The closed form does not match the paper's cross-section either, whose error is \
    smaller than that of the whole: the section gives the high middle more weight, so its error \
    should be larger. The paper does not say which points it counts; with the floor, whose height \
    is exact, both errors would be smaller. With f0 measured anew, or by triangulation, nothing of \
    this error remains at any distance: it is not caused by the bench, nor by blur, which reduces \
    contrast but not accuracy.";

const FLOOR: &str = "HD is the largest and MDTA the mean distance between measured and true \
    surface. From points to surface (both ways) they show errors. From points to points, they also \
    show the spacing of the points; here they are taken from 60,000 samples, spread over the lit \
    and visible part of the true surface, to the nearest measured point. On a lattice of spacing s \
    the mean is 0.383 s and the largest 0.707 s. Pixels are 1.58 mm apart on a plane at 1000 mm, \
    which gives 0.60 and 1.12 mm, and more where a face leans away or creases leave pixels out. \
    The floor is the value that the true points of the same pixels would have; errors move points \
    to both sides of it. The paper's MDTA of 0.59 mm at 1000 mm is what the spacing alone gives on \
    a plane that faces the camera: from points to points, it describes pixels, not errors.";

fn row<'a>(rows: &'a Rows, distance: f64, method: &str) -> Option<&'a Row> {
    of(rows, "distance/")
        .find(|row| row.value("distance_mm") == distance && row.get("method") == method)
}

fn value(rows: &Rows, distance: f64, method: &str, column: &str) -> f64 {
    row(rows, distance, method).map_or(f64::NAN, |row| row.value(column))
}

/// Tabulates MAE and CMAE of each method, with the values of the paper and of the closed form.
fn means(rows: &Rows) -> Table {
    let mut table = Table::new(
        "paper-distances",
        "Trapezoid at L: mean absolute errors in mm. Closed form: the formula with f0 held at its \
         value for 1000 mm, without noise, by area of the frustum and by length of its section.",
        &[
            "L in mm",
            "MAE, paper",
            "closed form",
            "f0 held",
            "f0 remeasured",
            "triangulation",
            "CMAE, paper",
            "closed form",
            "f0 held",
            "f0 remeasured",
            "triangulation",
        ],
    );
    for (l, paper) in DISTANCES {
        let ours = |column| [HELD, ANEW, TRIANGULATION].map(|m| three(value(rows, l, m, column)));
        let mut cells = vec![
            format!("{l}"),
            three(paper.mae),
            figures(mean_over_base(l), 3),
        ];
        cells.extend(ours("mae_mm"));
        cells.push(three(paper.cmae));
        cells.push(figures(mean_over_section(l), 3));
        cells.extend(ours("cmae_mm"));
        table.row(cells);
    }
    table
}

/// Tabulates HD and MDTA, to surfaces and to points.
fn distances(rows: &Rows) -> Table {
    let mut table = Table::new(
        "paper-agreement",
        "Trapezoid at L: Hausdorff distance (HD) and mean distance to agreement (MDTA) in mm, by \
         triangulation except in the columns of f0, which are distances to the surface.",
        &[
            "L in mm",
            "HD, paper",
            "f0 held",
            "f0 remeasured",
            "to surface",
            "to points",
            "floor",
            "MDTA, paper",
            "f0 held",
            "f0 remeasured",
            "to surface",
            "to points",
            "floor",
        ],
    );
    for (l, paper) in DISTANCES {
        let cells = |kind: &str, paper: f64| {
            [
                three(paper),
                three(value(rows, l, HELD, &format!("{kind}_surface_mm"))),
                three(value(rows, l, ANEW, &format!("{kind}_surface_mm"))),
                three(value(rows, l, TRIANGULATION, &format!("{kind}_surface_mm"))),
                three(value(rows, l, TRIANGULATION, &format!("{kind}_points_mm"))),
                three(value(rows, l, TRIANGULATION, &format!("{kind}_floor_mm"))),
            ]
        };
        let mut all = vec![format!("{l}")];
        all.extend(cells("hd", paper.hd));
        all.extend(cells("mdta", paper.mdta));
        table.row(all);
    }
    table
}

/// Tabulates inlier error, gross errors and coverage separately; MAE and CMAE mix them.
fn apart(rows: &Rows) -> Table {
    let mut table = Table::new(
        "paper-apart",
        "The same scans by triangulation: inlier error, gross errors (more than 1 mm, and more \
         than 5 stated standard deviations, edges included), coverage, and difference between the \
         heights with f0 held and the closed form.",
        &[
            "L in mm",
            "points",
            "coverage in %",
            "gross in %",
            "beyond 5 sigma in %",
            "inlier RMSE in mm",
            "f0 in 1/mm",
            "f0 held, closed form, same pixels in mm",
            "difference from closed form in mm",
        ],
    );
    for (l, _) in DISTANCES {
        let own = |column| value(rows, l, TRIANGULATION, column);
        table.row([
            format!("{l}"),
            format!("{}", own("points")),
            percent(own("coverage")),
            percent(own("gross")),
            percent(own("beyond_5_sigma")),
            three(own("inlier_rmse_mm")),
            figures(value(rows, l, ANEW, "f0_per_mm"), 4),
            three(value(rows, l, HELD, "closed_mm")),
            three(value(rows, l, HELD, "closed_off_mm")),
        ]);
    }
    table
}

fn chart(rows: &Rows) -> Chart {
    let ours = |name: &str, method: &str| {
        let points = DISTANCES.map(|(l, _)| (l, value(rows, l, method, "mae_mm")));
        Series::new(name, SeriesStyle::Both, points)
    };
    let closed = (0..=80).map(|i| 800.0 + 5.0 * f64::from(i));
    // At 1000 mm the error is 0, which interrupts the curve on the logarithmic axis.
    let closed = closed.map(|l| (l, mean_over_base(l)));
    Chart {
        heading: "Trapezoid: mean absolute error".to_owned(),
        x: "distance L in mm".to_owned(),
        y: "MAE in mm".to_owned(),
        log: [false, true],
        series: vec![
            Series::new(
                "the paper",
                SeriesStyle::Both,
                DISTANCES.map(|(l, paper)| (l, paper.mae)),
            ),
            Series::new("f0 held, closed form", SeriesStyle::Dashed, closed),
            ours("formula, f0 held at its value for 1000 mm", HELD),
            ours("formula, f0 measured anew", ANEW),
            ours("triangulation", TRIANGULATION),
        ],
    }
}

fn checks(rows: &Rows) -> Vec<Check> {
    let mut checks = Vec::new();
    for (l, paper) in DISTANCES {
        if l == MEASURED_AT_MM {
            for (name, column, paper) in [
                ("MAE", "mae_mm", paper.mae),
                ("CMAE", "cmae_mm", paper.cmae),
            ] {
                checks.push(Check::at_most(
                    format!("{name} at 1000 mm by triangulation in mm"),
                    value(rows, l, TRIANGULATION, column),
                    paper / SMALLER,
                ));
            }
        }
        checks.push(Check::at_most(
            format!("height with f0 held at {l} mm: difference from the closed form in mm"),
            value(rows, l, HELD, "closed_off_mm"),
            CLOSED_MM,
        ));
    }
    checks
}
