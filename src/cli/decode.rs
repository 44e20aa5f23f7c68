//! `phasmid decode`: decodes images of a sequence to projector coordinates and points.

use super::decoding::{HeldArg, doubt, name_calibration};
use super::method::MethodArgs;
use super::output::step;
use phasmid_calibrate::files::{Sizes, read_rig_sized};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::check_folder;
use phasmid_core::output_folder::OutputFolder;
use phasmid_decode::{
    Decoder, Options, Plan, Summary, frame_size, load_frames, output_names, write_outputs,
};
use phasmid_pattern::{Image, Manifest};
use std::path::{Path, PathBuf};

/// Decode images of projected patterns to projector coordinates and, with a calibration, to points
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid decode --manifest scan/sequence.toml --out decoded")]
pub(super) struct Args {
    /// Sequence manifest: what was projected, frame by frame
    #[arg(long, value_name = "FILE")]
    manifest: PathBuf,
    /// Folder for the results; created if it does not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder of the images [default: the manifest's]
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Calibration, which adds cloud.ply and depth.npy: calibration.toml, or OpenCV's YAML, XML or
    /// JSON, or SLStudio's formats
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    method: MethodArgs,
    /// Keep mixed pixels, which see two surfaces at once
    #[arg(long)]
    keep_mixed: bool,
    /// Weight the phase steps by their shot noise, which reduces noise with six or more equal steps
    #[arg(long)]
    weighted: bool,
    /// Treatment of the error due to held projector pixels
    #[arg(long, value_name = "HOW", default_value = "correct")]
    held: HeldArg,
    /// How to unwrap a single period without Gray code
    #[arg(long, value_name = "HOW")]
    unwrap: Option<Unwrap>,
    /// Minimum modulation in grey levels
    #[arg(long, value_name = "DN", default_value_t = Options::default().min_modulation_dn)]
    min_modulation: f32,
    /// Fail, instead of warning, if the images do not follow the manifest's sequence
    #[arg(long)]
    strict: bool,
    /// Overwrite results of an earlier run
    #[arg(long)]
    force: bool,
    /// Print the results as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Unwrap {
    /// Spatially, from pixel to pixel, beginning with the most precise pixels
    Spatial,
}

/// Runs the command.
///
/// # Errors
/// Returns an error if the manifest, an image, the calibration or an option is invalid, or a file
/// cannot be written.
pub(super) fn run(args: &Args) -> Result<()> {
    if !(args.min_modulation >= 0.0 && args.min_modulation.is_finite()) {
        return Err(Error::input(
            "--min-modulation",
            args.min_modulation,
            "a finite number of grey levels, 0 or more",
        ));
    }
    args.method.check()?;
    let manifest = Manifest::read(&args.manifest).map_err(|e| e.at("--manifest"))?;
    let plan = Plan::new(&manifest).map_err(|e| name_file(e, &args.manifest))?;
    let beside = args.manifest.parent().unwrap_or(Path::new(""));
    let folder = args.frames.as_deref().unwrap_or(beside);
    let sizes = Sizes {
        camera: frame_size(&manifest, &plan, folder),
        projector: Some([manifest.projector.width_px, manifest.projector.height_px]),
    };
    let read = |path: &PathBuf| read_rig_sized(path, sizes);
    let rig = args.calibration.as_ref().map(read).transpose();
    let rig = rig.map_err(|e| e.at("--calibration"))?;
    check_folder(&args.out, output_names(), args.force)?;
    step("reading the frames");
    let images = load_frames(&manifest, &plan, folder)?;
    step("decoding");
    let [width, height] = Image::common_size(&images)?;
    let options = Options {
        keep_mixed: args.keep_mixed,
        weighted: args.weighted,
        held: args.held.into(),
        unwrap_spatial: args.unwrap.is_some(),
        min_modulation_dn: args.min_modulation,
        ..Options::default()
    };
    let decoder = Decoder::new(&manifest, width, height, rig.as_ref(), options)
        .map_err(|e| name_calibration(name_file(e, &args.manifest), args.calibration.as_deref()))?;
    let mut decoded = decoder.decode(&images)?;
    let doubt = doubt(
        &args.manifest,
        &manifest,
        &images,
        rig.as_ref(),
        args.strict,
    )?;
    args.method.apply(&decoder, &mut decoded, options)?;
    let files = manifest
        .frame
        .iter()
        .filter_map(|frame| frame.file.as_ref());
    let inputs = files
        .map(|file| folder.join(file))
        .chain([args.manifest.clone()])
        .chain(args.calibration.clone());
    step("writing");
    let output = OutputFolder::create(&args.out, args.force)?.sparing(inputs);
    let names = write_outputs(output.draft(), &decoder, &decoded)?;
    output.finish(output_names(), None)?;
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

/// Adds the manifest's path to an error about the sequence that the manifest describes.
fn name_file(error: Error, manifest: &Path) -> Error {
    match error {
        Error::Input {
            place,
            found,
            expected,
        } if place.starts_with("sequence") => {
            Error::input(format!("{}: {place}", manifest.display()), found, expected)
        }
        other => other,
    }
}
