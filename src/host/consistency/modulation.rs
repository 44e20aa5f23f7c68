//! Whether the camera sees what is projected at all.

use super::grid::{Grid, range, runs, share};
use super::main_axis;
use phasmid_core::error::{Error, Result};
use phasmid_decode::{FringeSet, Plan};
use phasmid_pattern::{Image, Manifest};

/// Least modulation in DN, as the decoder has it.
const LEAST_DN: f64 = 2.0;
/// Deviations of its noise that a modulation has to reach.
const LEAST_SIGMAS: f64 = 5.0;
/// Variance that the fringes explain, per degree of freedom, over what they leave.
const EXPLAINED: f64 = 4.0;

/// Least share of all pixels that follow in runs, for frames to show a sequence.
const LEAST_FOLLOWING: f64 = 1e-3;
/// Or, for thin and small objects: the least share of the pixels that vary,
const LEAST_OF_VARYING: f64 = 0.5;
/// and the least pixels.
const LEAST_PIXELS: usize = 12;

/// Share of saturated pixels that is the likeliest cause of frames that follow nothing.
const MANY_SATURATED: f64 = 0.2;

/// How much of the frames follows their sequence.
pub(super) struct Following {
    /// Share of the pixels, 0 to 1, that follow in runs along a line.
    share: f64,
    /// Whether most pixels that vary follow, in runs or not.
    most: bool,
    /// Share of the pixels, 0 to 1, that are at the camera's full scale in some frame.
    saturated: f64,
}

impl Following {
    /// Whether the frames show the sequence: a surface, or thin or small objects before still
    /// surroundings.
    pub(super) fn is_shown(&self) -> bool {
        self.share >= LEAST_FOLLOWING || self.most
    }

    /// Why frames that do not show the sequence may not.
    fn cause(&self) -> String {
        match self.saturated >= MANY_SATURATED {
            true => format!(
                "{:.0} % are saturated: shorten the exposure, lower the gain, or keep other light out",
                100.0 * self.saturated
            ),
            false => {
                "the camera does not see the projector, or its frames are not those of the sequence"
                    .to_owned()
            }
        }
    }
}

/// Rejects images that show no surface: hardly any pixel follows the sequence, and most of the
/// variation has another cause.
///
/// # Errors
/// Returns an error if the camera does not see the projected patterns.
pub fn check_modulation(manifest: &Manifest, images: &[Image]) -> Result<()> {
    match following(manifest, images) {
        Some(found) if !found.is_shown() => Err(Error::device(format!(
            "the frames show no modulation: {:.2} % of the pixels follow the sequence, \
             expected {} % or more; {}",
            100.0 * found.share,
            100.0 * LEAST_FOLLOWING,
            found.cause()
        ))),
        _ => Ok(()),
    }
}

/// The pixels that follow the sequence: white is brighter than black by half of all variation, and
/// fringes explain their frames. `None` where the sequence has neither, or the frames are not as
/// many as it has.
pub(super) fn following(manifest: &Manifest, frames: &[Image]) -> Option<Following> {
    let plan = Plan::new(manifest).ok()?;
    let references = plan.white.zip(plan.black);
    let sets: Vec<&FringeSet> = plan.axes.iter().flat_map(|axis| &axis.sets).collect();
    let lacking = frames.len() != plan.frames || frames.iter().any(Image::is_empty);
    let unlike = lacking || Image::common_size(frames).is_err();
    if unlike || (references.is_none() && sets.is_empty()) {
        return None;
    }
    let grid = Grid::new(frames, main_axis(&plan));
    let noise_dn = f64::from(grid.noise_dn);
    let follows = |values: &[f32]| {
        let (low, high) = range(values);
        let lit = references.is_none_or(|(white, black)| {
            let contrast = f64::from(values[white] - values[black]);
            let least = (0.5 * f64::from(high - low)).max(LEAST_DN);
            contrast >= least.max(LEAST_SIGMAS * noise_dn)
        });
        lit && (sets.is_empty() || sets.iter().any(|set| modulated(set, values, noise_dn)))
    };
    let (mut varying, mut follow) = (0usize, 0usize);
    let mut in_runs = Vec::new();
    for line in &grid.lines {
        let which: Vec<bool> = (0..line.len()).map(|i| follows(line.pixel(i))).collect();
        for (i, follows) in which.iter().enumerate() {
            if grid.varies(line.pixel(i)) {
                varying += 1;
                follow += usize::from(*follows);
            }
        }
        in_runs.extend(runs(which));
    }
    Some(Following {
        share: share(in_runs.into_iter()),
        most: follow >= LEAST_PIXELS && follow as f64 >= LEAST_OF_VARYING * varying as f64,
        saturated: grid.at_full_scale(),
    })
}

fn modulated(set: &FringeSet, values: &[f32], noise_dn: f64) -> bool {
    let samples: Vec<f64> = set.frames.iter().map(|f| f64::from(values[*f])).collect();
    let [_, c, s] = set.solve(&samples);
    let n = samples.len() as f64;
    let modulation = c.hypot(s);
    let least = LEAST_DN.max(LEAST_SIGMAS * noise_dn * (2.0 / n).sqrt());
    let explained = 0.25 * n * modulation * modulation;
    let left = set.residual(&samples) / (n - 3.0).max(1.0);
    modulation >= least && explained >= EXPLAINED * left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_without_modulation_name_the_likely_cause() {
        let manifest = Manifest::parse(
            "[projector]\nwidth_px = 64\nheight_px = 48\n\
             [[frame]]\npattern = { kind = \"white\" }\n\
             [[frame]]\npattern = { kind = \"black\" }\n\
             [[frame]]\npattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 0 }\n\
             [[frame]]\npattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 2.0943951 }\n\
             [[frame]]\npattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 4.1887902 }\n",
            "test",
        )
        .unwrap();
        let why = |level: u8| {
            let image = Image::new(64, 48, vec![level; 64 * 48]).unwrap();
            let refused = check_modulation(&manifest, &vec![image; 5]);
            refused.unwrap_err().to_string()
        };
        assert!(why(255).contains("100 % are saturated"), "{}", why(255));
        assert!(
            why(90).contains("does not see the projector"),
            "{}",
            why(90)
        );
    }
}
