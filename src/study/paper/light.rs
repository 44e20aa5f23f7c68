//! Light levels of 0.5, 1 and 2, with ambient light, saturation and halo.

use super::bench::{around_trapezoid, bench, surface, trapezoid};
use super::figures::{Target, of, percent, three};
use super::published::LIGHT;
use super::scan::Scan;
use phasmid_calibrate::height::Mapping;
use phasmid_core::error::Result;
use phasmid_pattern::{Axis, Pattern};
use phasmid_profile::{Glare, Profile, Scene};
use phasmid_render::truth::Truth;
use phasmid_report::lab::{Block, Context, Row, Rows, Section, Settings, Table, Trial};
use std::f64::consts::TAU;

/// Light levels: of the projector relative to the bench's own, or of the room in W/m^2.
const LEVELS: [f64; 3] = [0.5, 1.0, 2.0];

/// Effects that are added to the projector's light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Around {
    /// The scene's own ambient light, 0.02 W/m^2, and a perfect lens.
    Dark,
    /// Ambient light of 0.2 W/m^2, a fifth of the projector's irradiance at a metre.
    Ambient,
    /// As `Ambient`, with a lens with halo and a sensor that blooms.
    Halo,
    /// As `Halo`, but the room's light varies, in W/m^2, and the projector keeps the bench's level.
    Room,
}

impl Around {
    const ALL: [Self; 4] = [Self::Dark, Self::Ambient, Self::Halo, Self::Room];

    fn name(self) -> &'static str {
        match self {
            Self::Dark => "dark room",
            Self::Ambient => "lit room",
            Self::Halo => "lit room, halo",
            Self::Room => "room light, halo",
        }
    }

    /// Returns the bench and the trapezoid at 1000 mm under this light.
    ///
    /// At a metre, 1 W/sr gives 1 W/m^2. The halo is 3 % over 40 px, the upper end of what ISO 9358
    /// finds for lenses with many elements; blooming passes on a tenth of the excess charge.
    fn set(self, level: f64, quick: bool) -> Result<(Profile, Scene)> {
        let projector = if self == Self::Room { 1.0 } else { level };
        let mut profile = bench(projector, around_trapezoid(quick))?;
        let mut scene = trapezoid(1000.0)?;
        match self {
            Self::Dark => {}
            Self::Ambient | Self::Halo => scene.ambient.irradiance_w_m2 = 0.2,
            Self::Room => scene.ambient.irradiance_w_m2 = level,
        }
        if matches!(self, Self::Halo | Self::Room) {
            profile.camera.glare = Some(Glare {
                percent: 3.0,
                sigma_px: 40.0,
            });
            profile.camera.sensor.blooming_percent = 10.0;
        }
        Ok((profile, scene))
    }
}

const MASKED: &str = "masked";
const PLAIN: &str = "plain";

/// Returns one trial for each light in each surroundings.
pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let mut all = Vec::new();
    for around in Around::ALL {
        for light in LEVELS {
            let word = match around {
                Around::Dark => "dark",
                Around::Ambient => "ambient",
                Around::Halo => "halo",
                Around::Room => "room",
            };
            let key = format!("light/{word}/{light}");
            all.push(Trial::new(key, settings.seed, move |context| {
                under(context, light, around)
            }));
        }
    }
    all
}

/// Returns a row for our decoder, which rejects saturated pixels, and a row for a plain decoder, which
/// uses every pixel.
fn under(context: &Context<'_>, light: f64, around: Around) -> Result<Vec<Row>> {
    let (profile, scene) = around.set(light, context.settings.quick)?;
    let scan = Scan::new(&profile, &scene, context.seed)?;
    let target = Target::new(&surface(&scene)?, scan.rig(), &scan.truth);
    let saturated = |&&i: &&usize| scan.truth.flags[i] & Truth::SATURATED != 0;
    let share = target.on.iter().filter(saturated).count() as f64 / target.on.len() as f64;
    let row = |mask: &str, depth: &[f32]| -> Result<Row> {
        let row = Row::new()
            .text("case", around.name())
            .text("method", mask)
            .number("light", light)
            .number("ambient_w_m2", scene.ambient.irradiance_w_m2)
            .number("saturated", share);
        Ok(target.figures(depth, None, &scan.truth)?.row(row))
    };
    Ok(vec![
        row(MASKED, &scan.decoded.depth)?,
        row(PLAIN, &plain(&scan)?)?,
    ])
}

/// Returns depths in mm from the arctangent of the twelve steps alone, at every pixel that the
/// projector lights. No pixel is rejected, and the fringe order is the one nearest to the truth, so all
/// errors are phase errors. On this bench the height formula is exact.
fn plain(scan: &Scan) -> Result<Vec<f32>> {
    let mut steps = Vec::new();
    for (i, frame) in scan.scanned.manifest.frame.iter().enumerate() {
        if let Pattern::Fringe {
            axis: Axis::X,
            period_px,
            phase_rad,
        } = frame.pattern
        {
            steps.push((period_px, phase_rad.sin_cos(), scan.frame(i)?));
        }
    }
    let period = steps.first().map_or(f64::NAN, |step| step.0);
    let mapping = Mapping::of_plane(scan.rig(), Axis::X, period, 1000.0)?;
    let depth = |i: usize| {
        let known = f64::from(scan.truth.projector_x[i]);
        if scan.truth.flags[i] & Truth::LIT == 0 || !known.is_finite() {
            return f32::NAN;
        }
        let (mut sine, mut cosine) = (0.0_f64, 0.0_f64);
        for (_, (sin, cos), frame) in &steps {
            sine += sin * f64::from(frame[i]);
            cosine += cos * f64::from(frame[i]);
        }
        // If all frames read the same, the phase is undefined; use 0.
        if sine.abs().max(cosine.abs()) < 1e-6 {
            (sine, cosine) = (0.0, 1.0);
        }
        // Over evenly spaced phases, A + B cos(x + phase) times the sine of the phase sums to -N B
        // sin(x) / 2, and times the cosine to N B cos(x) / 2.
        let within = (-sine).atan2(cosine) / TAU * period;
        let x = within + ((known - within) / period).round() * period;
        let found = mapping.depth_mm(i, x, 0.0);
        found.map_or(f32::NAN, |(z, _)| z as f32)
    };
    Ok((0..scan.truth.depth_mm.len()).map(depth).collect())
}

/// Returns a table.
pub(super) fn section(rows: &Rows) -> Section {
    let mut table = Table::new(
        "paper-light",
        "Trapezoid at 1000 mm by triangulation under light of 0.5, 1 and 2, in mm. Plain: \
         arctangent of the twelve steps at every lit pixel, without rejection, with the fringe \
         order from the truth. The paper's three rows are listed with the light at the same \
         position in the list.",
        &[
            "light",
            "saturated in %",
            "coverage in %",
            "MAE",
            "inlier RMSE",
            "gross in %",
            "HD",
            "MDTA",
            "plain: MAE",
            "gross in %",
            "HD",
            "MDTA",
            "paper: MAE",
            "HD",
            "MDTA",
        ],
    );
    for around in Around::ALL {
        for (light, paper) in LEVELS.into_iter().zip(LIGHT) {
            let find = |mask: &str| {
                of(rows, "light/").find(|row| {
                    row.value("light") == light
                        && row.get("case") == around.name()
                        && row.get("method") == mask
                })
            };
            let (masked, plain) = (find(MASKED), find(PLAIN));
            let value = |row: Option<&Row>, column| row.map_or(f64::NAN, |row| row.value(column));
            table.row([
                format!("{light}, {}", around.name()),
                percent(value(masked, "saturated")),
                percent(value(masked, "coverage")),
                three(value(masked, "mae_mm")),
                three(value(masked, "inlier_rmse_mm")),
                percent(value(masked, "gross")),
                three(value(masked, "hd_surface_mm")),
                three(value(masked, "mdta_surface_mm")),
                three(value(plain, "mae_mm")),
                percent(value(plain, "gross")),
                three(value(plain, "hd_surface_mm")),
                three(value(plain, "mdta_surface_mm")),
                three(paper.mae),
                three(paper.hd),
                three(paper.mdta),
            ]);
        }
    }
    Section::new(
        "Light",
        vec![
            Block::Words(WORDS.to_owned()),
            Block::Table(table),
            Block::Words(TREND.to_owned()),
        ],
    )
}

const WORDS: &str = "Light 1 is the bench's own projector: white on an albedo of 0.8 at 1000 mm \
    fills three quarters of a pixel's well. A lit room adds 0.2 W/m^2 of ambient light, a fifth of \
    what the projector gives at a metre; halo adds a lens that scatters 3 % of the light over 40 \
    px and a sensor that blooms. It is not clear whether the paper's 0.5, 1 and 2 refer to the \
    projector or to the room, so both are shown: in the last three rows the projector is unchanged \
    and the room has 0.5, 1 and 2 W/m^2.";

const TREND: &str = "With the projector's light, our errors do not grow as the paper's do. \
    Saturated pixels are rejected, so the coverage falls instead, and HD and MDTA grow with the \
    holes. Keeping them would cost little while a part of the fringe is left: a clipped sine has \
    harmonics, but of these, twelve steps let only those near the eleventh and thirteenth reach \
    the phase. With twice the light and halo that part is small, and the plain errors are five \
    times ours. In light in which even the dark part of a fringe saturates there is no phase at \
    all: a plain arctangent is off by up to half a fringe, which is 7.3 mm at 1000 mm. Room light \
    does this: the plain decoder's errors then grow towards those of the paper's last row, whereas \
    ours reports that nothing was measured.";
