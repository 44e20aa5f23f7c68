//! `phasmid decode`: photographs of a sequence to projector coordinates and points.

use super::method::MethodArgs;
use phasmid_calibrate::files::{Sizes, read_rig_sized};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::check_folder;
use phasmid_decode::{
    Decoded, Decoder, FrameStack, Options, Plan, Summary, frame_size, load_frames, output_names,
    write_outputs,
};
use phasmid_host::{check_pictures, doubt_pictures};
use phasmid_pattern::Manifest;
use std::path::{Path, PathBuf};

/// Decode photographs of projected patterns to projector coordinates, and with a calibration to
/// points
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Sequence manifest: what was projected, frame by frame
    #[arg(long, value_name = "FILE")]
    manifest: PathBuf,
    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder of the photographs [default: the manifest's]
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Calibration: adds cloud.ply and depth.npy. calibration.toml, or OpenCV's YAML, XML or JSON,
    /// or SLStudio's formats
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    method: MethodArgs,
    /// Keep pixels that read two surfaces at once
    #[arg(long)]
    keep_mixed: bool,
    /// Weigh the steps by their shot noise: less noise of six or more equal steps
    #[arg(long)]
    weighted: bool,
    /// How a single period without Gray code is unwrapped
    #[arg(long, value_name = "HOW")]
    unwrap: Option<Unwrap>,
    /// Least modulation in grey levels
    #[arg(long, value_name = "DN", default_value_t = Options::default().min_modulation_dn)]
    min_modulation: f32,
    /// Refuse pictures that do not follow the manifest's sequence, in place of a warning
    #[arg(long)]
    strict: bool,
    /// Overwrite results of an earlier run
    #[arg(long)]
    force: bool,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Unwrap {
    /// From pixel to pixel, the best first
    Spatial,
}

/// Runs the command.
///
/// # Errors
/// A manifest, photograph or calibration that does not do, or what the system refuses.
pub(super) fn run(args: &Args) -> Result<()> {
    if !(args.min_modulation >= 0.0 && args.min_modulation.is_finite()) {
        return Err(Error::input(
            "--min-modulation",
            args.min_modulation,
            "a finite number of grey levels, 0 or more",
        ));
    }
    args.method.check()?;
    let manifest = Manifest::read(&args.manifest)?;
    let plan = Plan::new(&manifest).map_err(|e| name_file(e, &args.manifest))?;
    let beside = args.manifest.parent().unwrap_or(Path::new(""));
    let folder = args.frames.as_deref().unwrap_or(beside);
    let sizes = Sizes {
        camera: frame_size(&manifest, &plan, folder),
        projector: Some([manifest.projector.width_px, manifest.projector.height_px]),
    };
    let read = |path: &PathBuf| read_rig_sized(path, sizes);
    let rig = args.calibration.as_ref().map(read).transpose()?;
    check_folder(&args.out, output_names(), args.force)?;
    let frames = load_frames(&manifest, &plan, folder)?;
    let options = Options {
        keep_mixed: args.keep_mixed,
        weighted: args.weighted,
        unwrap_spatial: args.unwrap.is_some(),
        min_modulation_dn: args.min_modulation,
        ..Options::default()
    };
    let decoder = Decoder::new(
        &manifest,
        frames.width,
        frames.height,
        rig.as_ref(),
        options,
    )
    .map_err(|e| name_calibration(name_file(e, &args.manifest), args.calibration.as_deref()))?;
    let stack = frames.stack();
    let mut decoded = decoder.decode(&stack)?;
    let doubt = doubt(&args.manifest, &manifest, &stack, &decoded, args.strict)?;
    args.method.apply(&decoder, &mut decoded, options)?;
    std::fs::create_dir_all(&args.out).map_err(|e| Error::io(&args.out, e))?;
    let names = write_outputs(&args.out, &decoder, &decoded)?;
    let summary = Summary::new(&decoder, &decoded);
    if args.json {
        let mut figures = serde_json::to_value(&summary).expect("numbers and strings");
        figures["doubt"] = doubt.into();
        println!("{figures:#}");
    } else {
        print!("{summary}");
        println!("written      {}: {}", args.out.display(), names.join(", "));
    }
    Ok(())
}

/// Holds pictures and what they decode to against their sequence: what speaks against them. A projector whose response is not
/// straight is reason enough for a doubt, and no reason to give nothing.
///
/// # Errors
/// What speaks against them, where that is to be an error.
pub(super) fn doubt(
    place: &Path,
    manifest: &Manifest,
    stack: &FrameStack<'_>,
    decoded: &Decoded,
    strict: bool,
) -> Result<Option<String>> {
    let departs = check_pictures(manifest, stack).err();
    let doubt = || doubt_pictures(manifest, stack).or_else(|| decoded.doubt());
    let Some(why) = departs.or_else(doubt) else {
        return Ok(None);
    };
    if strict {
        let allowed = "pictures of this sequence in its order";
        return Err(Error::input(place.display(), why, allowed));
    }
    eprintln!("phasmid: {}: {why}", place.display());
    Ok(Some(why))
}

/// Puts the manifest's name before an error about the sequence in it.
fn name_file(error: Error, manifest: &Path) -> Error {
    match error {
        Error::Input {
            place,
            found,
            allowed,
        } if place.starts_with("sequence") => {
            Error::input(format!("{}: {place}", manifest.display()), found, allowed)
        }
        other => other,
    }
}

/// Puts the calibration file's name into an error about the calibration.
pub(super) fn name_calibration(error: Error, calibration: Option<&Path>) -> Error {
    match (error, calibration) {
        (
            Error::Input {
                place,
                found,
                allowed,
            },
            Some(path),
        ) => {
            let place = match place.strip_prefix("calibration: ") {
                Some(field) => format!("{}: {field}", path.display()),
                None => place,
            };
            Error::input(place, found, allowed)
        }
        (other, _) => other,
    }
}
