//! Study `sgrt`: the accuracy with which a tumour is tracked through the skin, with ideal skins and
//! with skin as a scanner measures it.
//!
//! Each patient lies on the couch on the day of treatment, set up by hand and with breathing that
//! differs from planning. The tracker knows only the planning folder. At moments spread over the
//! breathing it gets the true skin, the true skin with noise, and the skin scanned by the three ceiling
//! pods (`inputs`). The tracked position and shape of the tumour are compared with the truth at the
//! middle of the scan (`trial`). The effects that an ideal input hides are measured one by one, by
//! leaving each out of the scan (`terms`).

mod inputs;
mod paired;
mod path;
mod pictures;
mod tables;
mod terms;
mod trial;

use phasmid_core::error::Result;
use phasmid_phantom::patient_names;
use phasmid_report::lab::{Block, Folder, Rows, Section, Settings, Study, Trial};

/// The study.
pub struct Sgrt;

/// Numbers of scans.
#[derive(Debug, Clone, Copy)]
struct Effort {
    /// Number of moments per patient.
    moments: usize,
    /// Number of scans during the breath that is tracked continuously.
    path: usize,
}

impl Effort {
    fn of(settings: &Settings) -> Self {
        match settings.quick {
            true => Self {
                moments: 2,
                path: 2,
            },
            false => Self {
                moments: 4,
                path: 16,
            },
        }
    }
}

/// The patient shown in images.
const PICTURED: &str = "p02-man-mean";
/// The patients of the quick form.
const QUICK: [&str; 2] = ["p02-man-mean", "p12-woman-full-chest"];

fn patients(settings: &Settings) -> Vec<&'static str> {
    match settings.quick {
        true => QUICK.to_vec(),
        false => patient_names().collect(),
    }
}

impl Study for Sgrt {
    fn name(&self) -> &'static str {
        "sgrt"
    }

    fn about(&self) -> &'static str {
        "A tumour tracked through the skin of fifteen patients (two in the quick form), with ideal \
         and with scanned skin."
    }

    fn title(&self) -> &'static str {
        "Surface-guided radiotherapy: a tumour followed through the skin"
    }

    fn columns(&self) -> &'static [&'static str] {
        &[
            "patient",
            "time_s",
            "input",
            "x_mm",
            "y_mm",
            "z_mm",
            "tpe_mm",
            "dice",
            "error_x_mm",
            "error_y_mm",
            "error_z_mm",
            "deviation_mm",
            "moved_mm",
            "late_mm",
            "points",
            "skin_coverage",
            "skin_bias_mm",
            "skin_rmse_mm",
            "skin_gross",
            "skin_beyond_5_sigma",
            "warnings",
        ]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let effort = Effort::of(settings);
        let names = patients(settings);
        let mut trials: Vec<Trial> = names
            .iter()
            .enumerate()
            .map(|(i, &name)| {
                // Each trial has its own noise.
                let seed = settings.seed.wrapping_add(16 * i as u64);
                Trial::new(format!("patient/{name}"), seed, move |context| {
                    trial::follow(context, name, effort.moments)
                })
            })
            .collect();
        trials.push(pictures::trial(settings, PICTURED));
        trials.push(path::trial(settings, PICTURED, effort.path));
        Ok(trials)
    }

    fn sections(&self, rows: &Rows, _: &Folder, settings: &Settings) -> Result<Vec<Section>> {
        let names = patients(settings);
        let blocks = |mut blocks: Vec<Block>, more: Vec<Block>| {
            blocks.extend(more);
            blocks
        };
        Ok(vec![
            Section::new(
                "Method",
                vec![Block::Words(format!("{} {COMPARED}", names.len()))],
            ),
            Section::new("Examples", vec![pictures::block(), path::block(rows)]),
            Section {
                title: "Position and shape of the tumour".to_owned(),
                blocks: blocks(
                    vec![Block::Words(POSITION.to_owned())],
                    tables::blocks(rows, &names),
                ),
            },
            Section {
                title: "Effects that ideal skins do not have".to_owned(),
                blocks: blocks(
                    vec![Block::Words(TERMS.to_owned())],
                    terms::blocks(rows, &names),
                ),
            },
        ])
    }
}

/// Text above the tables; the number of patients precedes it.
const COMPARED: &str = "generated patients lie on the couch on the day of treatment. Each was set \
    up by hand some millimetres and degrees off, breathes deeper or shallower than at planning, \
    and drifts. The tracker knows only the planning folder: the skin, the tumour and ten \
    displacement fields of one breathing cycle. It gets three kinds of skin: points of the true \
    skin, the same points with Gaussian noise of 0.5 mm along each axis, and the skin as a client \
    decodes it from scans by the three ceiling pods in turn, with cameras of 320 x 240 pixels. The \
    results are compared with the truth at the middle of the scan. Patients, tracker and scanner \
    are not those of the paper, so compare only the order of magnitude with its figures.";

const POSITION: &str = "With an ideal skin, the error that remains comes from what the skin cannot \
    show: the hysteresis between skin and tumour, and breathing that differs from planning. The \
    set-up adds to it, because the skin shows it only as well as its shape allows.";

const TERMS: &str = "Each row compares two inputs at the same moments that differ in one effect: \
    the scan of the breathing patient with a scan of the patient frozen in its middle; that with a \
    scan of skin that light does not enter; that with one by sensors without noise; that with the \
    true skin at the same pixels; and that with all of the true skin. These rows lead from the \
    ideal skin to the scanned one, so that their sum is the difference in the table above.";
