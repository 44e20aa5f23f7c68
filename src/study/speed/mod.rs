//! `speed`: rates of every pass beside a memory copy (`passes`, of `cases`), and latency from the
//! trigger's command to the whole frame at the host over each link (`latency`).

pub mod cases;
mod document;
mod latency;
mod passes;
#[cfg(target_os = "linux")]
mod served;

use super::lab::{Document, Folder, Rows, Settings, Study, Trial};
use crate::error::Result;

/// The study.
pub struct Speed;

impl Study for Speed {
    fn name(&self) -> &'static str {
        "speed"
    }

    fn about(&self) -> &'static str {
        "Rates of every pass beside a memory copy, latency from trigger to frame over each link"
    }

    fn columns(&self) -> &'static [&'static str] {
        &[
            "group",
            "name",
            "pixels",
            "frames",
            "bytes",
            "pass_us",
            "copy_us",
            "median_us",
            "p99_us",
            "least_us",
            "most_us",
            "note",
        ]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let mut trials = passes::trials(settings);
        trials.extend(latency::trials(settings));
        Ok(trials)
    }

    fn document(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Document> {
        Ok(document::document(rows))
    }
}
