//! `phasmid patient`: the generated patients, and what planning knows of one, or of a real one.

mod import;

use phasmid_core::error::Result;
use phasmid_phantom::{Patient, Phantom, patient_names};
use std::path::{Path, PathBuf};

/// Patients: the generated ones, who breathe, and planning folders, of them or of a clinic's data
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the patients that are built in.
    List,
    /// Check a patient and say what it is.
    Check {
        /// A built-in patient, or a TOML file.
        patient: String,
    },
    /// Write what planning knows of a patient: the skin, the tumour and how both move over ten phases of
    /// breathing, as `phasmid track` takes it.
    Plan {
        /// A built-in patient, or a TOML file.
        patient: String,
        /// Folder for the files.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Overwrite an earlier planning.
        #[arg(long)]
        force: bool,
        /// Distance of the voxels of displacement fields and CT.
        #[arg(long, value_name = "MM", default_value_t = 5.0)]
        spacing_mm: f64,
        /// Write the CT of the reference phase too.
        #[arg(long)]
        ct: bool,
    },
    /// Make a planning folder of a clinic's data: a CT, displacement fields and a tumour, all in the CT's
    /// own LPS.
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
    super::step(&format!("{}: skin, tumour and ten fields", patient.name));
    Phantom::new(patient).export_planning(out, spacing_mm, ct, force)?;
    println!(
        "{}: planning.toml, skin.ply, tumour.ply, dvf_00.mha to dvf_90.mha",
        out.display()
    );
    Ok(())
}
