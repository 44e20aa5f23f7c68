//! Writes a line of CSV for each scan.

use crate::cli::interrupt::uninterrupted;
use crate::cli::output::STANDARD_OUTPUT;
use crate::{Tracked, TumourPosition};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_sgrt::{Beam, ScanWarning, six};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Writes the lines to a file or standard output.
pub(super) struct Table {
    path: Option<PathBuf>,
    /// Whether to overwrite an existing file.
    force: bool,
    begin: Instant,
    /// Number of coefficients of the motion model.
    modes: usize,
    /// Destination of the lines; `None` until the first line is written.
    to: Option<BufWriter<Box<dyn Write>>>,
}

impl Table {
    /// Makes a table for a file, or for standard output. Writes nothing before the first line. Times
    /// count from `begin`; `modes` is the number of coefficients of the motion model.
    pub(super) fn new(path: Option<&Path>, force: bool, begin: Instant, modes: usize) -> Self {
        Self {
            path: path.map(Path::to_owned),
            force,
            begin,
            modes,
            to: None,
        }
    }

    fn names(modes: usize) -> Vec<String> {
        let mut names: Vec<String> = ["scan", "unix_s", "host_s", "device_s", "points"]
            .map(String::from)
            .into();
        for name in six::NAMES {
            let unit = if name.chars().all(char::is_uppercase) {
                "mm"
            } else {
                "deg"
            };
            names.push(format!("{}_{unit}", name.to_lowercase()));
            names.push(format!("{}_sd_{unit}", name.to_lowercase()));
        }
        for axis in ["x", "y", "z"] {
            names.push(format!("tumour_{axis}_mm"));
            names.push(format!("tumour_{axis}_sd_mm"));
        }
        for mode in 1..=modes {
            names.push(format!("mode_{mode}"));
            names.push(format!("mode_{mode}_sd"));
        }
        let rest = [
            "tumour_off_mm",
            "rms_mm",
            "coverage",
            "decode_ms",
            "host_ms",
            "since_motion_ms",
            "beam",
            "why",
        ];
        names.extend(rest.map(String::from));
        names
    }

    /// Adds a line which states that the beam is held because no scan has arrived.
    ///
    /// # Errors
    /// Returns an error as [`Self::row`] does.
    pub(super) fn silent(&mut self, scan: u64, beam: &Beam) -> Result<()> {
        let columns = Self::names(self.modes).len();
        let mut fields = self.first(scan, "");
        fields.resize(columns - 2, String::new());
        fields.extend(verdict(beam, &[]));
        self.line(&fields)
    }

    /// Returns the first fields of a line: the scan's number and the times.
    fn first(&self, scan: u64, device_s: &str) -> Vec<String> {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH);
        vec![
            scan.to_string(),
            format!("{:.3}", unix.unwrap_or_default().as_secs_f64()),
            format!("{:.4}", self.begin.elapsed().as_secs_f64()),
            device_s.to_owned(),
        ]
    }

    /// Adds a line for a scan. Unknown values are left empty.
    ///
    /// # Errors
    /// Returns an error if the line cannot be written.
    pub(super) fn row(&mut self, tracked: &Tracked) -> Result<()> {
        let device_s = format!("{:.6}", tracked.time.as_secs_f64());
        let mut fields = self.first(tracked.scan, &device_s);
        fields.push(tracked.points.to_string());
        let skin = tracked.skin.as_ref();
        for axis in 0..3 {
            fields.push(number(skin.map(|s| s.shift_mm[axis])));
            fields.push(number(skin.map(|s| s.shift_sd_mm[axis])));
        }
        for axis in 0..3 {
            fields.push(number(skin.map(|s| s.rotation_deg[axis])));
            fields.push(number(skin.map(|s| s.rotation_sd_deg[axis])));
        }
        let tumour = |value: &dyn Fn(&TumourPosition) -> f64| {
            let value = tracked.tumour.as_ref().map(value);
            number(value)
        };
        for axis in 0..3 {
            fields.push(tumour(&|t| t.position_mm[axis]));
            fields.push(tumour(&|t| t.sd_mm[axis]));
        }
        for mode in 0..self.modes {
            fields.push(tumour(&|t| t.modes[mode]));
            fields.push(tumour(&|t| t.modes_sd[mode]));
        }
        fields.push(tumour(&|t| t.off_mm));
        fields.push(tumour(&|t| t.rms_mm));
        fields.push(tumour(&|t| t.coverage));
        fields.push(ms(tracked.decoding));
        fields.push(ms(tracked.latency));
        fields.push(tracked.since_motion.map_or(String::new(), ms));
        fields.extend(verdict(&tracked.beam, &tracked.warnings));
        self.line(&fields)
    }

    /// Writes a line and flushes it, so that readers see it at once.
    fn line(&mut self, fields: &[String]) -> Result<()> {
        let path = self.path.as_deref();
        let failed = |e| match path {
            Some(path) => Error::io(path, e),
            None => Error::io(STANDARD_OUTPUT, e),
        };
        let to = match &mut self.to {
            Some(to) => to,
            None => {
                let to = self.to.insert(BufWriter::new(opened(path, self.force)?));
                writeln!(to, "{}", Self::names(self.modes).join(",")).map_err(failed)?;
                to
            }
        };
        writeln!(to, "{}", fields.join(","))
            .and_then(|()| to.flush())
            .map_err(failed)
    }
}

fn number(value: Option<f64>) -> String {
    value.map_or(String::new(), |value| format!("{value:.4}"))
}

fn ms(time: Duration) -> String {
    format!("{:.2}", time.as_secs_f64() * 1e3)
}

/// Returns the fields `beam` and `why`: the state of the beam, and its reason with all warnings.
fn verdict(beam: &Beam, warnings: &[ScanWarning]) -> [String; 2] {
    let (beam, why) = match beam {
        Beam::On => ("on", String::new()),
        Beam::Held(reason) => ("held", reason.to_string()),
    };
    let mut words: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    if !why.is_empty() && !words.contains(&why) {
        words.insert(0, why);
    }
    let words = words.join("; ").replace('"', "'");
    [beam.to_owned(), format!("\"{words}\"")]
}

fn opened(path: Option<&Path>, force: bool) -> Result<Box<dyn Write>> {
    Ok(match path {
        Some(path) => Box::new(uninterrupted(|| new_file::stream(path, force))?),
        None => Box::new(std::io::stdout()),
    })
}
