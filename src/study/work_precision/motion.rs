//! Geometry of moving scenes, interpolated between key instants, against geometry traced at the instant.

use phasmid_core::error::Result;
use phasmid_device::Device;
use phasmid_profile::{Interreflection, Profile, Scene};
use phasmid_render::{Interpolation, Options, shot::Shot};
use phasmid_report::lab::{Block, Check, Context, Row, Rows, Section, Settings, Table, Trial};
use phasmid_report::plot::figures;

/// Device times in nanoseconds at which geometry is compared.
const TIMES_NS: [u64; 4] = [437_000_000, 1_263_000_000, 2_391_000_000, 3_517_000_000];
/// Maximum displacement of a rigid motion, in millimetres.
const FAR_MM: f64 = 40.0;
/// Maximum rotation, in degrees.
const FAR_DEG: f64 = 20.0;
/// Maximum difference of any pixel, as a multiple of the tolerance.
const WORST: f64 = 10.0;
/// Maximum mean of the signed differences, in projector pixels.
const MEAN_PX: f64 = 0.002;

const TORSO: &str = r#"{ kind = "torso", triangles = 20000 }"#;
const SPHERE: &str = r#"{ kind = "sphere", radius_mm = 150.0 }"#;
const ROD: &str = r#"{ kind = "cylinder", radius_mm = 2.0, length_mm = 300.0 }"#;
const BOARD: &str = r#"{ kind = "board", board = { pattern = "dots", columns = 25, rows = 19, pitch_mm = 24.0, dot_mm = 10.0, marker_mm = 20.0 } }"#;
const INDIRECT: Interreflection = Interreflection {
    error_percent: 1.0,
    samples: Some(64),
    step_px: Some(8),
};

/// Name, shape, whether the object rotates, and speeds in mm/s or degrees/s.
const KINDS: [(&str, &str, bool, &[f64]); 4] = [
    ("torso", TORSO, false, &[0.01, 1.0, 10.0, 100.0, 1000.0]),
    ("turning torso", TORSO, true, &[0.1, 1.0, 10.0, 100.0]),
    ("sphere", SPHERE, false, &[1.0, 10.0, 100.0]),
    ("rod", ROD, false, &[10.0, 100.0, 1000.0]),
];
/// Speeds of the quick form.
const QUICK: [f64; 2] = [10.0, 1000.0];
/// Number of frames that the quick form renders.
const QUICK_SHOTS: usize = 3;

/// Returns a trial for each motion and tolerance.
pub fn trials(settings: &Settings) -> Vec<Trial> {
    let tolerances: &[f64] = if settings.quick {
        &[0.01]
    } else {
        &[0.01, 0.1]
    };
    let mut trials = Vec::new();
    for &tolerance_px in tolerances {
        for (name, shape, turns, speeds) in KINDS {
            let wanted = |speed: &&f64| !settings.quick || QUICK.contains(speed);
            for &speed in speeds.iter().filter(wanted) {
                let unit = if turns { "deg/s" } else { "mm/s" };
                let name = format!("{name}, {speed} {unit}");
                trials.push(trial(settings, name, tolerance_px, move || {
                    let scene = moving(shape, speed, turns)?;
                    Ok((Profile::load("webcam-grey")?, scene))
                }));
            }
        }
        if !settings.quick {
            let board = "board, 10 mm/s".to_owned();
            trials.push(trial(settings, board, tolerance_px, || {
                Ok((Profile::load("webcam-grey")?, moving(BOARD, 10.0, false)?))
            }));
            for (name, interreflection) in [
                ("breathing patient", None),
                ("patient, indirect light", Some(INDIRECT)),
            ] {
                trials.push(trial(settings, name.to_owned(), tolerance_px, move || {
                    let mut scene = Scene::load("treatment-room")?;
                    scene.interreflection = interreflection;
                    Ok((Profile::load("sgrt-pod")?, scene))
                }));
            }
        }
    }
    trials
}

fn trial(
    settings: &Settings,
    name: String,
    tolerance_px: f64,
    load: impl Fn() -> Result<(Profile, Scene)> + Send + Sync + 'static,
) -> Trial {
    let key = format!("motion/{name}/{tolerance_px}");
    Trial::new(key, settings.seed, move |context| {
        let (profile, scene) = load()?;
        run(context, &name, (&profile, &scene), tolerance_px)
    })
    .alone()
}

/// Creates a scene with a wall and an object that oscillates.
fn moving(shape: &str, speed: f64, turns: bool) -> Result<Scene> {
    let far = speed.min(if turns { FAR_DEG } else { FAR_MM });
    let quarter_s = far / speed;
    let keys: Vec<String> = [0.0, 1.0, 0.0, -1.0]
        .iter()
        .enumerate()
        .map(|(k, share)| {
            let (time_s, way) = (k as f64 * quarter_s, share * far);
            let pose = match turns {
                true => format!("rotation_deg = [0.0, {way}, 0.0]"),
                false => format!("position_mm = [{}, 0.0, {}]", 0.8 * way, -0.6 * way),
            };
            format!("{{ time_s = {time_s:?}, {pose} }}")
        })
        .collect();
    let text = format!(
        "name = \"moving\"\ndescription = \"\"\n\
         [[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [0, 0, 1200]\nalbedo = 0.5\n\
         [[object]]\nshape = {shape}\nposition_mm = [0, 0, 1000]\nalbedo = 0.7\n\
         motion = {{ period_s = {:?}, keyframes = [{}] }}\n",
        4.0 * quarter_s,
        keys.join(", ")
    );
    Scene::parse(&text, "moving scene")
}

fn run(
    context: &Context<'_>,
    name: &str,
    (profile, scene): (&Profile, &Scene),
    motion_tolerance_px: f64,
) -> Result<Vec<Row>> {
    let options = Options {
        motion_tolerance_px,
        ..Options::default()
    };
    let device = Device::builder(profile, scene)
        .seed(context.seed)
        .options(options)
        .build()?;
    let shots = device.shots().into_iter().map(|(_, shot)| shot);
    let shots: Vec<Shot> = match context.settings.quick {
        true => shots.take(QUICK_SHOTS).collect(),
        false => shots.collect(),
    };
    let mut renderer = device.renderer;
    renderer.make_ready(&shots);
    let found: Vec<_> = TIMES_NS
        .iter()
        .filter_map(|time_ns| renderer.interpolation(*time_ns))
        .collect();
    let watch = context.stopwatch();
    let (most, enough_s) = if context.settings.quick {
        (1, 0.0)
    } else {
        (5, 1.0)
    };
    let mut seconds = |tolerance| {
        renderer.set_motion_tolerance(tolerance);
        let sequence_s = watch.fastest(most, enough_s, || {
            renderer.invalidate();
            for shot in &shots {
                std::hint::black_box(renderer.expose(shot));
            }
        });
        sequence_s / shots.len() as f64
    };
    let [traced_s, interpolated_s] = [0.0, motion_tolerance_px].map(&mut seconds);
    let worst = |of: fn(&Interpolation) -> f64| found.iter().map(of).fold(f64::NAN, f64::max);
    let row = Row::new()
        .text("group", "motion")
        .text("setting", name)
        .number("tolerance_px", motion_tolerance_px)
        .number("frames", found.len() as f64)
        .number("keys_ms", -worst(|i| -i.spacing_ms))
        .number("traced", worst(|i| i.traced))
        .number("median_px", worst(|i| i.median_px))
        .number("most_px", worst(|i| i.most_px))
        .number("worst_px", worst(|i| i.worst_px))
        .number("mean_px", worst(|i| i.mean_px.abs()))
        .number("missed", worst(|i| i.missed as f64))
        .number("render_s", interpolated_s)
        .number("without_ns", traced_s * 1e9);
    Ok(vec![row])
}

/// Returns the section of the rows.
pub fn section(rows: &Rows) -> Section {
    let all: Vec<&Row> = rows.with("group", "motion").collect();
    let about = "A camera of 640 x 480 pixels in front of a wall and an object that swings to and \
        fro at a mean speed, and a pod of the treatment room in front of its breathing patient. \
        With a motion tolerance, geometry is traced at key instants and interpolated between them; \
        the result is compared with geometry traced at four instants. If no key instants are close \
        enough for the motion, all geometry is traced.";
    let mut errors = Table::new(
        "work-precision-motion",
        "Interpolated geometry at four instants: number of interpolated instants, shortest time \
         between key instants, largest share of pixels that is traced, and differences between \
         interpolated and traced projector coordinates at the worst instant. Missed: pixels with \
         another object or other light.",
        &[
            "motion",
            "tolerance, px",
            "instants",
            "key interval, ms",
            "traced, %",
            "median, px",
            "99.9 %, px",
            "worst, px",
            "mean, px",
            "missed",
        ],
    );
    let mut times = Table::new(
        "work-precision-motion-times",
        "Milliseconds per frame of a sequence that starts at device time 0, including key \
         instants.",
        &["motion", "tolerance, px", "interpolated", "traced", "ratio"],
    )
    .timed();
    for row in &all {
        let [name, tolerance] = ["setting", "tolerance_px"].map(|name| row.get(name).to_owned());
        let number = |name: &str, digits| match row.value(name) {
            value if value.is_nan() => "-".to_owned(),
            value => figures(value, digits),
        };
        let traced = 100.0 * row.value("traced");
        errors.row([
            name.clone(),
            tolerance.clone(),
            row.get("frames").to_owned(),
            number("keys_ms", 3),
            if traced.is_nan() {
                "100".to_owned()
            } else {
                format!("{traced:.1}")
            },
            number("median_px", 1),
            number("most_px", 1),
            number("worst_px", 1),
            number("mean_px", 1),
            number("missed", 3),
        ]);
        let [fast, slow] = [row.value("render_s") * 1e3, row.value("without_ns") * 1e-6];
        times.row([
            name,
            tolerance,
            figures(fast, 3),
            figures(slow, 3),
            figures(slow / fast, 2),
        ]);
    }
    let over = |name: &str, of: &dyn Fn(&Row) -> f64| {
        let values = all.iter().map(|row| row.value(name) / of(row));
        values.fold(f64::NAN, f64::max)
    };
    let checks = vec![
        Check::at_most(
            "motion: 99.9 % quantile of the differences / tolerance",
            over("most_px", &|row| row.value("tolerance_px")),
            1.0,
        ),
        Check::at_most(
            "motion: worst difference / (10 * tolerance)",
            over("worst_px", &|row| WORST * row.value("tolerance_px")),
            1.0,
        ),
        Check::at_most(
            "motion: mean of the differences, in projector pixels",
            over("mean_px", &|_| 1.0),
            MEAN_PX,
        ),
        Check::at_most("motion: edges missed", over("missed", &|_| 1.0), 0.0),
    ];
    Section::new(
        "Interpolated geometry",
        vec![
            Block::Words(about.to_owned()),
            Block::Table(errors),
            Block::Table(times),
            Block::Checks(checks),
        ],
    )
}
