//! `phasmid compare`: compares a cloud with a true surface, as a table or as JSON.

use phasmid_calibrate::files::read_rig;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Cloud, Pose, Removed, Rig, View, ply};
use phasmid_measure::{
    Alignment, Comparison, Directed, GROSS_MM, GROSS_SIGMAS, IcpOptions, Surface, Truth, align,
    compare,
};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Compare a cloud with the true surface, both in millimetres in the rig's frame.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid compare scan/cloud.ply --truth wall.obj")]
pub(super) struct Args {
    /// Measured cloud (.ply).
    cloud: PathBuf,
    /// True surface: a mesh (.stl, .obj, .ply) or a cloud (.ply without faces).
    #[arg(long, value_name = "MESH|CLOUD")]
    truth: PathBuf,
    /// First align the cloud with the truth by point-to-plane ICP, which needs a nearby start.
    #[arg(long)]
    align: bool,
    /// Calibration of the rig that captured the cloud. It determines which parts of a true mesh the
    /// rig can light and see.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

#[derive(serde::Serialize)]
struct Report {
    #[serde(flatten)]
    comparison: Comparison,
    /// Number of measured points at (0, 0, 0), which are dropped.
    points_at_origin: usize,
    /// Number of points at (0, 0, 0) of a true cloud, which are dropped too.
    truth_points_at_origin: usize,
    /// Triangles of a true mesh that are dropped.
    truth_triangles_removed: Removed,
    #[serde(skip_serializing_if = "Option::is_none")]
    alignment: Option<Alignment>,
}

/// Runs the command.
pub(super) fn run(args: &Args) -> Result<()> {
    let mut cloud = ply::read_cloud(&args.cloud)?;
    let points_at_origin = drop_origin(&mut cloud, &args.cloud)?;
    let mut truth = Truth::read(&args.truth).map_err(|e| e.at("--truth"))?;
    let (mut truth_points_at_origin, mut truth_triangles_removed) = (0, Removed::default());
    match &mut truth {
        Truth::Mesh(mesh) => {
            let place = args.truth.display().to_string();
            let removed = mesh.clean(&place).map_err(|e| e.at("--truth"))?;
            if removed.total() > 0 {
                eprintln!("phasmid: {place}: {removed}");
            }
            truth_triangles_removed = removed;
        }
        Truth::Cloud(cloud) => {
            let dropped = drop_origin(cloud, &args.truth).map_err(|e| e.at("--truth"))?;
            truth_points_at_origin = dropped;
        }
    }
    let rig = args.calibration.as_deref().map(read_rig).transpose();
    let mut rig = rig.map_err(|e| e.at("--calibration"))?;
    let surface = Surface::new(&truth)?;
    let alignment = args
        .align
        .then(|| align(&cloud, &surface, &IcpOptions::default()))
        .transpose()
        .map_err(|e| at_file(e, &args.cloud))?;
    if let Some(found) = &alignment {
        let motion = found.truth_from_cloud;
        cloud = cloud.moved(&motion);
        // Move the rig with the cloud, so that the rig's pose relative to the cloud stays the same.
        rig = rig.map(|rig| Rig {
            camera: moved(rig.camera, &motion),
            projector: moved(rig.projector, &motion),
            ..rig
        });
    }
    let comparison =
        compare(&cloud, &truth, &surface, rig.as_ref()).map_err(|e| at_file(e, &args.cloud))?;
    let report = Report {
        comparison,
        points_at_origin,
        truth_points_at_origin,
        truth_triangles_removed,
        alignment,
    };
    let text = if args.json {
        serde_json::to_string_pretty(&report).map_err(Error::device)? + "\n"
    } else {
        table(&report)
    };
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        // The program that reads standard output has closed the pipe.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| Error::io(super::output::STANDARD_OUTPUT, e)),
    }
}

/// Drops the points at (0, 0, 0), prints their number and returns it.
fn drop_origin(cloud: &mut Cloud, path: &Path) -> Result<usize> {
    let all = cloud.points.len();
    let dropped = cloud.drop_origin();
    if cloud.points.is_empty() {
        return Err(Error::input(
            path.display(),
            format!("{all} points, all at (0, 0, 0), which marks invalid points"),
            "at least one measured point",
        ));
    }
    if dropped > 0 {
        let place = path.display();
        eprintln!(
            "phasmid: {place}: dropped {dropped} of {all} points at (0, 0, 0), which marks invalid points"
        );
    }
    Ok(dropped)
}

fn moved(view: View, motion: &Pose) -> View {
    View {
        rig_from_view: *motion * view.rig_from_view,
        ..view
    }
}

/// Replaces the word `cloud` as the place of an error by the file's path.
fn at_file(error: Error, path: &Path) -> Error {
    match error {
        Error::Input {
            place,
            found,
            expected,
        } if place == "cloud" => Error::input(path.display(), found, expected),
        other => other,
    }
}

fn table(report: &Report) -> String {
    let found = &report.comparison;
    let columns = [
        ("cloud to truth", Some(found.cloud_to_truth)),
        ("truth to cloud", found.truth_to_cloud),
        ("both", found.both),
    ];
    let mut out = format!("{:<24}", "");
    for (name, _) in columns {
        out += &format!("{name:>16}");
    }
    out.push('\n');
    let mut row = |name: &str, value: fn(&Directed) -> String| {
        out += &format!("{name:<24}");
        for (_, column) in &columns {
            out += &format!("{:>16}", column.as_ref().map_or("-".into(), value));
        }
        out.push('\n');
    };
    row("points", |d| d.points.to_string());
    row("MAE, MDTA (mm)", |d| format!("{:.4}", d.mae_mm));
    row("RMSE (mm)", |d| format!("{:.4}", d.rmse_mm));
    row("RMSE of inliers (mm)", |d| {
        format!("{:.4}", d.inlier_rmse_mm)
    });
    row("95th percentile (mm)", |d| format!("{:.4}", d.p95_mm));
    row("Hausdorff (mm)", |d| format!("{:.4}", d.hausdorff_mm));
    row("gross errors (%)", |d| {
        format!("{:.4}", 100.0 * d.gross_error_rate)
    });
    if let Some(stated) = found.stated {
        let (ratio, beyond) = (stated.error_over_sigma, 100.0 * stated.beyond_5_sigma);
        out += &format!("{:<24}{ratio:>16.3}\n", "error over sigma");
        let name = format!("beyond {GROSS_SIGMAS} sigma (%)");
        out += &format!("{name:<24}{beyond:>16.4}\n");
    }
    if let Some(coverage) = found.coverage {
        out += &format!("{:<24}{:>16.2}\n", "coverage (%)", 100.0 * coverage);
    }
    out += &format!("\nGross: more than {GROSS_MM} mm.");
    if found.points_ignored > 0 {
        out += &format!(
            " Left out: {} points that are not finite.",
            found.points_ignored
        );
    }
    if let Some(why) = &found.truth_to_cloud_absent {
        out += &format!(" Truth to cloud not computed: {why}.");
    }
    out.push('\n');
    if let Some(a) = &report.alignment {
        let t = a.truth_from_cloud.translation_mm;
        out += &format!(
            "Aligned: {} after {} steps, RMS {:.4} to {:.4} mm, moved by ({:.4}, {:.4}, {:.4}) mm, \
             {} of 6 degrees of freedom determined, condition {:.1}.\n\
             Last step {:.2e} mm, {:.2e} degrees, {:.2e} standard deviations; robust scale {:.4} mm; \
             {:.2} % of pairs kept, {:.2} % rejected as outliers.\n",
            if a.converged {
                "converged"
            } else {
                "NOT converged"
            },
            a.iterations,
            a.rms_before_mm,
            a.rms_after_mm,
            t.x,
            t.y,
            t.z,
            a.determined,
            a.condition,
            a.last_step_mm,
            a.last_step_deg,
            a.last_step_sigmas,
            a.robust_scale_mm,
            100.0 * a.kept,
            100.0 * a.rejected,
        );
    }
    out
}
