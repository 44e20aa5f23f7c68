//! `phasmid patient import`: makes a planning folder from a CT, displacement fields and a tumour.

use crate::cli::options::vector;
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_planning::import::{Import, Imported};
use phasmid_planning::isosurface::SKIN_HU;
use phasmid_planning::planning::PlanningFile;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// CT of the reference phase: a folder of DICOM files with one series or those of a 4D-CT, or a
    /// MetaImage in Hounsfield units (.mha, .mhd).
    #[arg(long, value_name = "PATH")]
    ct: PathBuf,
    /// Phase in per cent of the breathing cycle (0 is the end of inhalation) and its MetaImage
    /// displacement field from the reference phase, in millimetres along LPS. Repeat for each phase;
    /// the reference phase needs none.
    #[arg(long, value_name = "PERCENT=FILE", required = true)]
    phase: Vec<String>,
    /// Tumour at the reference phase, in the CT's LPS coordinates: a closed mesh (.ply, .stl, .obj) in
    /// millimetres, or a MetaImage mask, 0 outside and 1 inside.
    #[arg(long, value_name = "FILE")]
    tumour: PathBuf,
    /// Phase of the CT and the tumour, in per cent of the breathing cycle.
    #[arg(long, value_name = "PERCENT", default_value_t = 50.0)]
    reference_phase: f64,
    /// Threshold of the skin in Hounsfield units; the body is the largest connected region at or above
    /// it.
    #[arg(
        long,
        value_name = "HU",
        default_value_t = SKIN_HU,
        allow_negative_numbers = true
    )]
    skin_hu: f64,
    /// Isocentre in the CT's LPS coordinates, in millimetres [default: the tumour's centroid].
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    isocentre: Option<String>,
    /// Name of the patient in the planning folder [default: the folder's name].
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Voxel spacing of the written fields in millimetres, no finer than that of the input [default:
    /// the input's]. At a CT's full resolution the fields are too large to track with; 3 mm is
    /// sufficient.
    #[arg(long, value_name = "MM")]
    spacing_mm: Option<f64>,
    /// Also write the CT to the folder.
    #[arg(long)]
    with_ct: bool,
    /// Planning folder to write.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Overwrite an earlier planning.
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let import = Import {
        name: args.name(),
        ct: args.ct.clone(),
        skin_hu: args.skin_hu,
        tumour: args.tumour.clone(),
        isocentre_mm: args.isocentre()?,
        reference_percent: args.reference_phase,
        phases: args
            .phase
            .iter()
            .map(|text| phase(text))
            .collect::<Result<_>>()?,
        spacing_mm: args.spacing_mm,
        with_ct: args.with_ct,
        force: args.force,
    };
    let made = import.write(&args.out, &crate::cli::output::step)?;
    say(args, &import, &made);
    Ok(())
}

impl Args {
    fn isocentre(&self) -> Result<Option<DVec3>> {
        let point = |text| {
            let allowed = "X,Y,Z in millimetres, as -12.5,140,-812";
            vector("--isocentre", text, 1e5, allowed)
        };
        self.isocentre.as_deref().map(point).transpose()
    }

    /// Returns the given name, or else the output folder's name if that is a valid name of a
    /// patient.
    fn name(&self) -> String {
        let folder = || {
            let name = self.out.file_name()?.to_str()?;
            PlanningFile::is_name(name).then(|| name.to_owned())
        };
        let name = self.name.clone().or_else(folder);
        name.unwrap_or_else(|| "patient".to_owned())
    }
}

/// Parses `PERCENT=FILE`.
fn phase(text: &str) -> Result<(f64, PathBuf)> {
    let parts = text.split_once('=');
    let parsed = parts.and_then(|(percent, file)| Some((percent.trim().parse().ok()?, file)));
    match parsed {
        Some((percent, file)) if !file.is_empty() => Ok((percent, PathBuf::from(file))),
        _ => Err(Error::input(
            format!("--phase {text}"),
            "no phase",
            "PERCENT=FILE, as 50=dvf_50.mha",
        )),
    }
}

fn say(args: &Args, import: &Import, made: &Imported) {
    let place = |p: DVec3| {
        // Adding 0 turns -0 into 0.
        let [x, y, z] = p.to_array().map(|mm| (10.0 * mm).round() / 10.0 + 0.0);
        format!("({x:.1}, {y:.1}, {z:.1}) mm")
    };
    let file = &made.file;
    let fields: Vec<&str> = file
        .phase
        .iter()
        .map(|phase| phase.field.as_str())
        .collect();
    let mut files = vec!["planning.toml", &file.skin, &file.tumour];
    files.extend(file.ct.as_deref());
    println!(
        "{}: {}, {} to {}",
        args.out.display(),
        files.join(", "),
        fields[0],
        fields[fields.len() - 1]
    );
    let grid = &made.ct_grid;
    let ([ni, nj, nk], mm) = (grid.size, grid.spacing_mm);
    println!(
        "  ct          {}: {ni} x {nj} x {nk} voxels of {:.3} x {:.3} x {:.3} mm",
        made.ct, mm.x, mm.y, mm.z
    );
    println!(
        "  skin        at {} HU, {} triangles",
        args.skin_hu, made.skin_triangles
    );
    println!(
        "  tumour      {:.2} cm3 about {}",
        made.tumour_mm3 * 1e-3,
        place(made.tumour_mm)
    );
    println!("  isocentre   {}", place(file.isocentre_mm));
    println!(
        "  motion      over {} phases: tumour up to {:.1} mm, skin up to {:.1} mm",
        file.phase.len(),
        made.tumour_motion_mm,
        made.skin_motion_mm
    );
    let own = |(percent, _): &(f64, PathBuf)| *percent == import.reference_percent;
    if !import.phases.iter().any(own) {
        println!(
            "  reference   phase {} % has no displacement field: its displacements are zero",
            import.reference_percent
        );
    }
}
