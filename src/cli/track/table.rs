//! Writes a line of CSV for each scan.

use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_sgrt::{Beam, MotionFit, RigidFit, six};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Writes the lines to a file or standard output.
pub(super) struct Table {
    path: Option<PathBuf>,
    /// Whether to overwrite an existing file.
    force: bool,
    begin: Instant,
    /// Number of coefficients of the motion model.
    modes: usize,
    /// `None` before the first line.
    to: Option<BufWriter<Box<dyn Write>>>,
}

/// Results of one scan.
pub(super) struct Row<'a> {
    pub(super) scan: u64,
    /// End of the last exposure by the device's clock; 0 if the link carries no times.
    pub(super) device_s: f64,
    pub(super) rigid: Option<&'a RigidFit>,
    pub(super) motion: Option<&'a MotionFit>,
    /// Planned position of the tumour.
    pub(super) target: DVec3,
    pub(super) points: usize,
    pub(super) decode_ms: f64,
    /// Time from the arrival of the last frame to the answer.
    pub(super) host_ms: f64,
    /// Time from the middle of the scan to the answer: to the last frame by the device's clock, then by
    /// the host's. `None` if the links carry no times.
    pub(super) since_motion_ms: Option<f64>,
    pub(super) beam: &'a Beam,
    pub(super) warnings: &'a [String],
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

    /// Adds a line that the beam is held because no scan has arrived.
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

    /// Returns the first fields: the scan's number and the times.
    fn first(&self, scan: u64, device_s: &str) -> Vec<String> {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH);
        vec![
            scan.to_string(),
            format!("{:.3}", unix.unwrap_or_default().as_secs_f64()),
            format!("{:.4}", self.begin.elapsed().as_secs_f64()),
            device_s.to_owned(),
        ]
    }

    /// Adds a scan. Unknown values are empty.
    ///
    /// # Errors
    /// Returns an error if the line cannot be written.
    pub(super) fn row(&mut self, row: &Row<'_>) -> Result<()> {
        let mut fields = self.first(row.scan, &format!("{:.6}", row.device_s));
        fields.push(row.points.to_string());
        let six = row
            .rigid
            .map(|fit| (fit.six.to_array(), fit.total_deviations()));
        for i in 0..6 {
            fields.push(six.map_or(String::new(), |(value, _)| format!("{:.4}", value[i])));
            fields.push(six.map_or(String::new(), |(_, sd)| format!("{:.4}", sd[i])));
        }
        for axis in 0..3 {
            let of = |f: &dyn Fn(&MotionFit) -> f64| {
                row.motion.map_or(String::new(), |m| format!("{:.4}", f(m)))
            };
            fields.push(of(&|m| m.tumour_mm[axis]));
            let variance = |m: &MotionFit| m.total_covariance(row.target).col(axis)[axis];
            fields.push(of(&|m| variance(m).max(0.0).sqrt()));
        }
        for mode in 0..self.modes {
            let of = |f: &dyn Fn(&MotionFit) -> f64| {
                row.motion.map_or(String::new(), |m| format!("{:.4}", f(m)))
            };
            fields.push(of(&|m| m.state.coefficients[mode]));
            fields.push(of(&|m| m.covariance[(mode, mode)].max(0.0).sqrt()));
        }
        let off = |m: &MotionFit| format!("{:.4}", (m.tumour_mm - row.target).length());
        fields.push(row.motion.map_or(String::new(), off));
        fields.push(
            row.motion
                .map_or(String::new(), |m| format!("{:.4}", m.rms_mm)),
        );
        fields.push(
            row.motion
                .map_or(String::new(), |m| format!("{:.4}", m.coverage)),
        );
        fields.push(format!("{:.2}", row.decode_ms));
        fields.push(format!("{:.2}", row.host_ms));
        let since = row.since_motion_ms;
        fields.push(since.map_or(String::new(), |ms| format!("{ms:.2}")));
        fields.extend(verdict(row.beam, row.warnings));
        self.line(&fields)
    }

    /// Writes a line and flushes it, so that readers see it at once.
    fn line(&mut self, fields: &[String]) -> Result<()> {
        let path = self.path.as_deref();
        let failed = |e| match path {
            Some(path) => Error::io(path, e),
            None => Error::io("standard output", e),
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

/// Returns the fields `beam` and `why`: the state of the beam, and its reason with all warnings.
fn verdict(beam: &Beam, warnings: &[String]) -> [String; 2] {
    let (beam, why) = match beam {
        Beam::On => ("on", String::new()),
        Beam::Held(reason) => ("held", reason.to_string()),
    };
    let mut words = warnings.to_vec();
    if !why.is_empty() && !words.contains(&why) {
        words.insert(0, why);
    }
    let words = words.join("; ").replace('"', "'");
    [beam.to_owned(), format!("\"{words}\"")]
}

fn opened(path: Option<&Path>, force: bool) -> Result<Box<dyn Write>> {
    Ok(match path {
        Some(path) => Box::new(new_file::stream(path, force)?),
        None => Box::new(std::io::stdout()),
    })
}
