//! `phasmid patient`: lists and checks generated patients, and writes planning folders of generated and
//! real ones.

mod import;

use super::progress::ProgressLine;
use phasmid_core::error::Result;
use phasmid_phantom::{Patient, Phantom, patient_names};
use std::path::{Path, PathBuf};

/// List or check generated breathing patients, or make planning folders from them or from clinical
/// data
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the built-in patients.
    #[command(after_help = "Example:\n  phasmid patient list")]
    List,
    /// Print a patient, as a starting point for your own.
    #[command(after_help = "Example:\n  phasmid patient show p02-man-mean > mine.toml")]
    Show {
        /// Built-in name, or path of a TOML file.
        name: String,
    },
    /// Check a patient and summarise it.
    #[command(after_help = "Example:\n  phasmid patient check p02-man-mean")]
    Check {
        /// Built-in name, or path of a TOML file.
        patient: String,
    },
    /// Write a patient's planning folder for `phasmid track`: the skin, the tumour and how both move over
    /// ten phases of breathing.
    #[command(after_help = "Example:\n  phasmid patient plan p02-man-mean --out planning")]
    Plan {
        /// Built-in name, or path of a TOML file.
        patient: String,
        /// Planning folder to write.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Overwrite an earlier planning.
        #[arg(long)]
        force: bool,
        /// Voxel spacing of the displacement fields and the CT, in millimetres.
        #[arg(long, value_name = "MM", default_value_t = 5.0)]
        spacing_mm: f64,
        /// Also write the CT of the reference phase.
        #[arg(long)]
        ct: bool,
    },
    /// Make a planning folder from clinical data: a CT, displacement fields and a tumour, all in the CT's
    /// LPS coordinates.
    #[command(
        after_help = "Example:\n  phasmid patient import --ct ct_50.mha --tumour tumour.ply --phase 0=dvf_00.mha --out imported"
    )]
    Import(import::Args),
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::List => {
            for name in patient_names() {
                println!("{name:<24}  {}", Patient::load(name)?.description);
            }
            Ok(())
        }
        Action::Show { name } => {
            print!("{}", Patient::text(name)?);
            Ok(())
        }
        Action::Check { patient } => {
            let patient = Patient::load(patient)?;
            describe(&patient);
            Ok(())
        }
        Action::Plan {
            patient,
            out,
            spacing_mm,
            ct,
            force,
        } => plan(&Patient::load(patient)?, out, *spacing_mm, *ct, *force),
        Action::Import(args) => import::run(args),
    }
}

fn describe(patient: &Patient) {
    let (breathing, day) = (&patient.breathing, &patient.treatment);
    println!("{}: ok", patient.name);
    println!("  {}", patient.description);
    println!(
        "  body        {} years, {:.0} mm, {:.0} kg, {:.1} kg/m2",
        patient.age_years,
        patient.stature_mm,
        patient.mass_kg,
        patient.body_mass_index()
    );
    println!("  tumour      {:.0} mm", patient.tumour.diameter_mm);
    println!(
        "  breathing   every {:.1} s: thorax {:.1} mm, abdomen {:.1} mm, diaphragm {:.1} mm",
        breathing.period_s, breathing.thorax_mm, breathing.abdomen_mm, breathing.diaphragm_mm
    );
    println!(
        "  treatment   {:.2} times as deep, abdomen drifts {:.1} mm, set up {:?} mm and {:?} degrees off",
        day.amplitude, day.drift_mm, day.setup_mm, day.setup_deg
    );
}

fn plan(patient: &Patient, out: &Path, spacing_mm: f64, ct: bool, force: bool) -> Result<()> {
    let name = format!("{}: skin, tumour and ten fields", patient.name);
    let line = ProgressLine::new(&name);
    Phantom::new(patient).export_planning(out, spacing_mm, ct, force)?;
    drop(line);
    println!(
        "{}: planning.toml, skin.ply, tumour.ply, dvf_00.mha to dvf_90.mha",
        out.display()
    );
    Ok(())
}
