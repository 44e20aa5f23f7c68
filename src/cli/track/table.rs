//! A line of CSV for each scan.

use crate::error::{Error, Result};
use crate::host::track::{Beam, MotionFit, RigidFit, six};
use glam::DVec3;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Where lines go.
pub(super) struct Table {
    to: BufWriter<Box<dyn Write>>,
    place: String,
}

/// What one scan has come to.
pub(super) struct Row<'a> {
    pub(super) scan: u64,
    /// Since the first scan, by the host's clock.
    pub(super) host_s: f64,
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
    pub(super) beam: &'a Beam,
    pub(super) warnings: &'a [String],
}

impl Table {
    /// Begins the table: a new file, or standard output.
    ///
    /// # Errors
    /// A file that is there already, and what the system refuses.
    pub(super) fn create(path: Option<&Path>) -> Result<Self> {
        let (to, place): (Box<dyn Write>, String) = match path {
            None => (Box::new(std::io::stdout()), "standard output".to_owned()),
            Some(path) => {
                let file = File::create_new(path).map_err(|e| match e.kind() {
                    std::io::ErrorKind::AlreadyExists => Error::input(
                        format!("--out {}", path.display()),
                        "a file that is there already",
                        "a new file",
                    ),
                    _ => Error::io(path, e),
                })?;
                (Box::new(file), path.display().to_string())
            }
        };
        let mut table = Self {
            to: BufWriter::new(to),
            place,
        };
        let mut names: Vec<String> = ["scan", "host_s", "device_s", "points"]
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
        let rest = [
            "tumour_off_mm",
            "rms_mm",
            "coverage",
            "decode_ms",
            "host_ms",
            "beam",
            "why",
        ];
        names.extend(rest.map(String::from));
        table.line(&names)?;
        Ok(table)
    }

    /// Adds a scan; what is not known is empty.
    ///
    /// # Errors
    /// What the system refuses.
    pub(super) fn row(&mut self, row: &Row<'_>) -> Result<()> {
        let mut fields = vec![
            row.scan.to_string(),
            format!("{:.4}", row.host_s),
            format!("{:.6}", row.device_s),
            row.points.to_string(),
        ];
        let six = row.rigid.map(|fit| (fit.six.to_array(), fit.deviations()));
        for i in 0..6 {
            fields.push(six.map_or(String::new(), |(value, _)| format!("{:.4}", value[i])));
            fields.push(six.map_or(String::new(), |(_, sd)| format!("{:.4}", sd[i])));
        }
        for axis in 0..3 {
            let of = |f: &dyn Fn(&MotionFit) -> f64| {
                row.motion.map_or(String::new(), |m| format!("{:.4}", f(m)))
            };
            fields.push(of(&|m| m.tumour_mm[axis]));
            fields.push(of(&|m| m.tumour_covariance.col(axis)[axis].max(0.0).sqrt()));
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
        let (beam, why) = match row.beam {
            Beam::On => ("on", String::new()),
            Beam::Held(reason) => ("held", reason.to_string()),
        };
        fields.push(beam.to_owned());
        let mut words = row.warnings.to_vec();
        if !why.is_empty() && !words.contains(&why) {
            words.insert(0, why);
        }
        fields.push(format!("\"{}\"", words.join("; ").replace('"', "'")));
        self.line(&fields)
    }

    fn line(&mut self, fields: &[String]) -> Result<()> {
        let line = fields.join(",");
        // Whoever follows it reads each scan as it comes.
        writeln!(self.to, "{line}")
            .and_then(|()| self.to.flush())
            .map_err(|e| Error::io(&self.place, e))
    }

    /// Ends the table.
    ///
    /// # Errors
    /// What the system refuses.
    pub(super) fn finish(mut self) -> Result<()> {
        self.to.flush().map_err(|e| Error::io(&self.place, e))
    }
}
