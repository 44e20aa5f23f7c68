//! A line of CSV for each scan.

use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_sgrt::{Beam, MotionFit, RigidFit, six};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Where lines go.
pub(super) struct Table {
    path: Option<PathBuf>,
    /// Whether it takes the place of an existing file.
    force: bool,
    begin: Instant,
    /// Coefficients that the motion has.
    modes: usize,
    /// None before the first line.
    to: Option<BufWriter<Box<dyn Write>>>,
}

/// What one scan has come to.
pub(super) struct Row<'a> {
    pub(super) scan: u64,
    /// The last frame's end by the device's clock; 0 where its link does not carry it.
    pub(super) device_s: f64,
    pub(super) rigid: Option<&'a RigidFit>,
    pub(super) motion: Option<&'a MotionFit>,
    /// Where the tumour was planned.
    pub(super) target: DVec3,
    pub(super) points: usize,
    pub(super) decode_ms: f64,
    /// From the last frame to the answer.
    pub(super) host_ms: f64,
    /// From the middle of the scan, by the device's clock, and from the last frame, by the host's, to the
    /// answer; none where the links carry no times.
    pub(super) since_motion_ms: Option<f64>,
    pub(super) beam: &'a Beam,
    pub(super) warnings: &'a [String],
}

impl Table {
    /// A table for a new file, or standard output, which both stay as they are until there is a line;
    /// times are since `begin`, and the motion has so many coefficients.
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

    /// Says that the beam is held though nothing has come.
    ///
    /// # Errors
    /// As for [`Self::row`].
    pub(super) fn silent(&mut self, scan: u64, beam: &Beam) -> Result<()> {
        let columns = Self::names(self.modes).len();
        let mut fields = self.first(scan, "");
        fields.resize(columns - 2, String::new());
        fields.extend(verdict(beam, &[]));
        self.line(&fields)
    }

    /// Number and times.
    fn first(&self, scan: u64, device_s: &str) -> Vec<String> {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH);
        vec![
            scan.to_string(),
            format!("{:.3}", unix.unwrap_or_default().as_secs_f64()),
            format!("{:.4}", self.begin.elapsed().as_secs_f64()),
            device_s.to_owned(),
        ]
    }

    /// Adds a scan; what is not known is empty.
    ///
    /// # Errors
    /// What the system refuses.
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

    /// Whoever follows it reads each line as it comes.
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

/// Whether the beam may be on, and all that is to be said.
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
