//! `speed`: rates of every pass beside a memory copy (`passes`, of `cases`), what options of the
//! decoder cost (`pairs`), and over each of the `links` the latency from the trigger's command to the
//! whole frame at the host (`latency`) and the frames a second (`throughput`).

pub mod cases;
mod document;
mod latency;
mod links;
pub mod pairs;
mod passes;
#[cfg(target_os = "linux")]
mod served;
mod talk;
mod throughput;

use phasmid_core::error::Result;
use phasmid_report::lab::{Folder, Rows, Section, Settings, Study, Trial};

/// The study.
pub struct Speed;

impl Study for Speed {
    fn name(&self) -> &'static str {
        "speed"
    }

    fn about(&self) -> &'static str {
        "Rates of every pass beside a memory copy, latency and frames a second over each link"
    }

    fn title(&self) -> &'static str {
        "Speed"
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
            "without_us",
            "median_us",
            "p99_us",
            "least_us",
            "most_us",
            "lost",
            "rate",
            "rate_low",
            "rate_high",
            "state",
            "note",
        ]
    }

    fn parts(&self) -> &'static [&'static str] {
        &["pass", "pair", "link"]
    }

    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let mut trials = passes::trials(settings);
        trials.extend(pairs::trials(settings));
        trials.push(latency::trial(settings));
        trials.push(throughput::trial(settings));
        Ok(trials)
    }

    fn sections(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Vec<Section>> {
        Ok(document::sections(rows))
    }
}
