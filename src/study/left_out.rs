//! Study `left-out`: the terms of image formation that the plan omits for each device and scene, the
//! time that this saves, and a check that the omission changes no byte of a frame.

use crate::timing::Timing;
use phasmid_core::error::Result;
use phasmid_device::Device;
use phasmid_profile::{Profile, Scene};
use phasmid_render::shot::Shot;
use phasmid_render::{Pass, Renderer, Term};
use phasmid_report::lab::{
    Block, Chart, Check, Context, Folder, Row, Rows, Section, Series, SeriesStyle, Settings, Study,
    Table, Trial,
};
use phasmid_report::plot::figures;

const PROFILES: [&str; 5] = [
    "webcam-grey",
    "dlp-evm",
    "pmp-bench",
    "pmp-real",
    "sgrt-pod",
];
const SCENES: [&str; 6] = [
    "plane",
    "sphere",
    "trapezoid",
    "board",
    "torso",
    "treatment-room",
];
/// Number of profiles and scenes in the quick form, from the start of each list.
const QUICK: (usize, usize) = (2, 2);
/// Number of frames of a sequence that are compared byte by byte and timed.
const COMPARED: usize = 3;
/// The timed passes and their columns; the exposure and the sensor pass run as one.
const PASSES: [(Pass, [&str; 2]); 2] = [
    (Pass::Geometry, ["geometry_ns", "geometry_all_ns"]),
    (Pass::Exposure, ["frame_ns", "frame_all_ns"]),
];

/// The study.
pub struct LeftOut;

impl Study for LeftOut {
    fn name(&self) -> &'static str {
        "left-out"
    }

    fn about(&self) -> &'static str {
        "Which terms does a scene not need, what does leaving them out save, and does it change a \
         byte?"
    }

    fn title(&self) -> &'static str {
        "Terms left out"
    }

    fn columns(&self) -> &'static [&'static str] {
        &[
            "profile",
            "scene",
            "pixels",
            "triangles",
            "terms",
            "left_out",
            "without",
            "frames",
            "bytes",
            "different",
            "geometry_ns",
            "geometry_all_ns",
            "frame_ns",
            "frame_all_ns",
        ]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let (profiles, scenes) = match settings.quick {
            true => (&PROFILES[..QUICK.0], &SCENES[..QUICK.1]),
            false => (&PROFILES[..], &SCENES[..]),
        };
        let trial = |profile: &'static str, scene: &'static str| {
            let work = move |context: &Context<'_>| run(context, profile, scene);
            Trial::new(format!("{profile}/{scene}"), settings.seed, work).alone()
        };
        let of = |&profile| scenes.iter().map(move |&scene| trial(profile, scene));
        Ok(profiles.iter().flat_map(of).collect())
    }

    fn sections(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Vec<Section>> {
        let about = "Image formation consists of terms, and the plan of a device and a scene \
            includes only those that they need. Here all other terms are forced in as well: this \
            must not change a byte of a frame, and the time that it takes is what the plan saves. \
            Times are nanoseconds per pixel on all threads; each frame of a moving scene has its \
            own geometry.";
        let counts = [
            ("device", "profile", 0),
            ("scene", "scene", 0),
            ("pixels", "pixels", 0),
            ("triangles", "triangles", 0),
            ("terms", "terms", 0),
            ("left out", "left_out", 0),
            ("frames compared", "frames", 0),
            ("bytes that differ", "different", 0),
        ];
        let caption = "Numbers of terms in the plan and left out of it, and comparison of the \
            frames with and without the latter.";
        let names = [
            ("device", "profile", 0),
            ("scene", "scene", 0),
            ("left out", "without", 0),
        ];
        let different: f64 = rows.all.iter().map(|row| row.value("different")).sum();
        let none = rows.all.iter().filter(|row| row.value("left_out") < 1.0);
        let checks = vec![
            Check::at_most("bytes changed by terms that are not needed", different, 0.0),
            Check::at_most(
                "devices and scenes that need every term",
                none.count() as f64,
                0.0,
            ),
        ];
        let blocks = vec![
            Block::Words(about.to_owned()),
            Block::Table(Table::of("left-out", caption, &rows.all, &counts)),
            Block::Table(times(rows)),
            Block::Figure(chart(rows).figure(
                "left-out",
                "Times with all terms against those with the plan",
            )),
            Block::Table(
                Table::of(
                    "left-out-terms",
                    "Terms that are left out.",
                    &rows.all,
                    &names,
                )
                .detail(),
            ),
            Block::Checks(checks),
        ];
        Ok(vec![Section::new("Plans", blocks)])
    }
}

fn run(context: &Context<'_>, profile: &str, scene: &str) -> Result<Vec<Row>> {
    let (device, setting) = (Profile::load(profile)?, Scene::load(scene)?);
    let build = || -> Result<(Renderer, Vec<Shot>)> {
        let mut device = Device::builder(&device, &setting)
            .seed(context.seed)
            .build()?;
        // Some forced terms disable the interpolation of a moving scene's geometry, so trace all
        // geometry.
        device.renderer.set_motion_tolerance(0.0);
        let shots = device.shots().into_iter().map(|(_, shot)| shot).collect();
        Ok((device.renderer, shots))
    };
    let (mut lean, shots) = build()?;
    lean.make_ready(&shots);
    let plan = lean.plan();
    let (terms, left_out): (Vec<Term>, Vec<Term>) =
        Term::ALL.into_iter().partition(|&term| plan.has(term));
    let (mut full, _) = build()?;
    for &term in &left_out {
        full.force(term, true);
    }
    let (mut bytes, mut different) = (0, 0);
    let every = shots.len().div_ceil(COMPARED).max(1);
    let compared: Vec<Shot> = shots.into_iter().step_by(every).collect();
    for shot in &compared {
        let [with, without] = [&mut full, &mut lean].map(|renderer| renderer.expose(shot).data);
        bytes += without.len();
        different += with.iter().zip(&without).filter(|(a, b)| a != b).count();
        different += with.len().abs_diff(without.len());
    }
    let names: Vec<String> = left_out.iter().map(ToString::to_string).collect();
    let mut row = Row::new()
        .text("profile", profile)
        .text("scene", scene)
        .number("pixels", lean.pixel_count() as f64)
        .number("triangles", lean.triangle_count() as f64)
        .number("terms", terms.len() as f64)
        .number("left_out", left_out.len() as f64)
        .text("without", &names.join(" "))
        .number("frames", compared.len() as f64)
        .number("bytes", bytes as f64)
        .number("different", different as f64);
    let mut timing = Timing::new(&mut lean, &compared, context.stopwatch());
    for (pass, [plan, all]) in PASSES {
        row = row
            .number(plan, timing.pass_ns(pass))
            .number(all, timing.full_ns(pass));
    }
    Ok(vec![row])
}

fn times(rows: &Rows) -> Table {
    let header = [
        "device",
        "scene",
        "geometry, ns/px",
        "geometry with all terms",
        "geometry saved, %",
        "frame, ns/px",
        "frame with all terms",
        "frame saved, %",
    ];
    let mut table = Table::new(
        "left-out-times",
        "Times with the plan and with all terms.",
        &header,
    )
    .timed();
    for row in &rows.all {
        let of = PASSES.iter().flat_map(|(_, names)| {
            let [plan, all] = names.map(|name| row.value(name));
            let saved = 100.0 * (1.0 - plan / all);
            [figures(plan, 3), figures(all, 3), format!("{saved:.0}")]
        });
        let names = ["profile", "scene"].map(|name| row.get(name).to_owned());
        table.row(names.into_iter().chain(of));
    }
    table
}

fn chart(rows: &Rows) -> Chart {
    let of = |name: &str, [plan, all]: [&str; 2]| {
        let point = |row: &Row| (row.value(plan), row.value(all));
        let mut series = Series::new(name, SeriesStyle::Dots, rows.all.iter().map(point));
        let tip = |row: &Row| format!("{}, {}", row.get("profile"), row.get("scene"));
        series.tips = rows.all.iter().map(tip).collect();
        series
    };
    let values = rows
        .all
        .iter()
        .flat_map(|row| PASSES.map(|(_, [plan, _])| row.value(plan)));
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), v| {
        (low.min(v), high.max(v))
    });
    let equal = [(low, low), (high, high)];
    Chart {
        heading: String::new(),
        x: "time with the plan, ns/px".to_owned(),
        y: "time with all terms, ns/px".to_owned(),
        log: [true; 2],
        series: vec![
            of("geometry", PASSES[0].1),
            of("frame", PASSES[1].1),
            Series::new("equal", SeriesStyle::Dashed, equal),
        ],
    }
}
