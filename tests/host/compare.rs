//! `phasmid compare` as a user runs it.

use glam::{DVec2, DVec3};
use phasmid::geometry::shapes::{Torso, torso};
use phasmid::geometry::{Cloud, Lens, Mesh, Pose, Rig, View, ply};
use std::path::Path;
use std::process::{Command, Output};

fn compare(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .arg("compare")
        .args(args)
        .current_dir(dir)
        .output()
        .unwrap()
}

fn complaint(dir: &Path, args: &[&str]) -> String {
    let output = compare(dir, args);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(output.stdout.is_empty());
    String::from_utf8(output.stderr).unwrap()
}

/// Writes a torso at a distance of 1 m, a cloud of its front that is 0.1 mm nearer to the camera,
/// and a rig.
fn scene(dir: &Path) {
    let mut mesh = torso(&Torso {
        triangles: 20_000,
        ..Torso::default()
    });
    mesh.vertices.iter_mut().for_each(|v| v.z += 1000.0);
    let points = (0..mesh.triangles.len())
        .filter(|&i| {
            let [a, b, c] = mesh.corners(i);
            (b - a).cross(c - a).normalize().z < -0.5
        })
        .map(|i| {
            let [a, b, c] = mesh.corners(i);
            let lifted = (a + b + c) / 3.0 + (b - a).cross(c - a).normalize() * 0.1;
            lifted.as_vec3().to_array()
        })
        .collect();
    let cloud = Cloud {
        points,
        ..Cloud::default()
    };
    ply::write_cloud(&dir.join("scan.ply"), &cloud).unwrap();
    let motion = Pose::from_xyz_deg(DVec3::new(3.0, 2.0, -4.0), DVec3::new(0.5, 0.3, -0.6));
    ply::write_cloud(&dir.join("moved.ply"), &cloud.moved(&motion)).unwrap();
    ply::write_mesh(&dir.join("truth.ply"), &mesh).unwrap();
    let lens = Lens {
        width_px: 1200,
        height_px: 900,
        focal_px: DVec2::splat(1000.0),
        principal_px: DVec2::new(599.5, 449.5),
        distortion: [0.0; 5],
    };
    let at = |x, y_deg| View {
        lens,
        rig_from_view: Pose::from_xyz_deg(DVec3::X * x, DVec3::Y * y_deg),
    };
    let rig = Rig {
        camera: at(0.0, 0.0),
        projector: at(300.0, -17.0),
        noise: None,
        covariance: None,
    };
    std::fs::write(dir.join("rig.toml"), rig.to_toml()).unwrap();
}

#[test]
fn prints_metrics_as_table_and_json() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    scene(dir);
    let table = compare(dir, &["scan.ply", "--truth", "truth.ply"]);
    assert!(table.status.success(), "{table:?}");
    let table = String::from_utf8(table.stdout).unwrap();
    assert!(table.contains("Hausdorff (mm)"), "{table}");
    assert!(
        table.contains("Truth to cloud not computed: a mesh needs a calibration"),
        "{table}"
    );

    let json = |args: &[&str]| -> serde_json::Value {
        let output = compare(dir, args);
        assert!(output.status.success(), "{output:?}");
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let found = json(&[
        "scan.ply",
        "--truth",
        "truth.ply",
        "--calibration",
        "rig.toml",
        "--json",
    ]);
    // Each point is 0.1 mm above its triangle; at the edge of a hollow, the neighbouring triangle
    // is slightly nearer.
    let mae = found["cloud_to_truth"]["mae_mm"].as_f64().unwrap();
    assert!((mae - 0.1).abs() < 1e-4, "{mae}");
    let back = found["truth_to_cloud"]["inlier_rmse_mm"].as_f64().unwrap();
    assert!((0.08..0.3).contains(&back), "{back}");
    // The cloud contains slopes up to 60 degrees; coverage counts the truth's slopes up to 80
    // degrees.
    let coverage = found["coverage"].as_f64().unwrap();
    assert!((0.8..0.999).contains(&coverage), "{coverage}");

    // After alignment, only the part of the offset that a translation cannot remove remains.
    let found = json(&["moved.ply", "--truth", "truth.ply", "--align", "--json"]);
    assert_eq!(found["alignment"]["converged"], true);
    assert_eq!(found["alignment"]["determined"], 6);
    let mae = found["cloud_to_truth"]["mae_mm"].as_f64().unwrap();
    assert!(mae < 0.05, "{mae}");
}

#[test]
fn refuses_bad_input_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    scene(dir);
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                  property float z\nend_header\n";
    std::fs::write(dir.join("nan.ply"), format!("{header}nan 0 0\n")).unwrap();
    std::fs::write(
        dir.join("empty.ply"),
        header.replace("vertex 1", "vertex 0"),
    )
    .unwrap();
    std::fs::write(dir.join("cut.stl"), [0_u8; 90]).unwrap();
    std::fs::write(dir.join("bad.toml"), "camera = 1\n").unwrap();
    for (args, says) in [
        (
            ["nan.ply", "--truth", "truth.ply"].as_slice(),
            "nan.ply: 1 points, none of them finite",
        ),
        (
            &["empty.ply", "--truth", "truth.ply"],
            "empty.ply: no point",
        ),
        (&["scan.ply", "--truth", "cut.stl"], "cut.stl: no triangle"),
        (&["scan.ply", "--truth", "absent.obj"], "absent.obj"),
        (&["scan.ply", "--truth", "rig.toml"], "`toml`"),
        (
            &["rig.toml", "--truth", "truth.ply"],
            "rig.toml:1: no `ply`",
        ),
        (
            &[
                "scan.ply",
                "--truth",
                "truth.ply",
                "--calibration",
                "bad.toml",
            ],
            "bad.toml",
        ),
        (&["scan.ply"], "--truth"),
    ] {
        let message = complaint(dir, args);
        assert!(message.contains(says), "{args:?}: {message}");
    }
}

#[test]
fn a_cloud_far_from_the_truth_cannot_be_aligned() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let mesh = Mesh {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    ply::write_mesh(&dir.join("truth.ply"), &mesh).unwrap();
    let cloud = Cloud {
        points: vec![[500.0, 500.0, 0.0]; 3],
        ..Cloud::default()
    };
    ply::write_cloud(&dir.join("scan.ply"), &cloud).unwrap();
    let message = complaint(dir, &["scan.ply", "--truth", "truth.ply", "--align"]);
    assert!(
        message.contains("scan.ply: no part of it lies near the truth"),
        "{message}"
    );
}

#[test]
fn invalid_points_and_redundant_triangles_are_dropped_with_a_note() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let mut mesh = Mesh {
        vertices: vec![
            DVec3::new(-50.0, -50.0, 500.0),
            DVec3::new(350.0, -50.0, 500.0),
            DVec3::new(-50.0, 350.0, 500.0),
        ],
        triangles: vec![[0, 1, 2]; 50_000],
        ..Mesh::default()
    };
    mesh.triangles.push([0, 0, 1]);
    ply::write_mesh(&dir.join("truth.ply"), &mesh).unwrap();
    // A cloud of a plane, many points at the origin as a scanner writes them for pixels without a
    // measurement, and one other point that is repeated many times.
    let grid = (0..100).flat_map(|x| (0..100).map(move |y| [x as f32, y as f32, 500.0]));
    let mut points: Vec<[f32; 3]> = grid.collect();
    points.extend([[5.0, 5.0, 500.0]; 40_000]);
    points.extend([[0.0; 3]; 40_000]);
    let mut cloud = Cloud {
        points,
        ..Cloud::default()
    };
    ply::write_cloud(&dir.join("scan.ply"), &cloud).unwrap();
    cloud.points = vec![[0.0; 3]; 40_000];
    ply::write_cloud(&dir.join("invalid.ply"), &cloud).unwrap();

    let run = |truth: &str| -> (serde_json::Value, String) {
        let output = compare(dir, &["scan.ply", "--truth", truth, "--json"]);
        assert!(output.status.success(), "{output:?}");
        let stderr = String::from_utf8(output.stderr).unwrap();
        (serde_json::from_slice(&output.stdout).unwrap(), stderr)
    };
    let dropped = "scan.ply: dropped 40000 of 90000 points at (0, 0, 0)";
    let (found, notes) = run("truth.ply");
    assert!(notes.contains(dropped), "{notes}");
    let removed = "truth.ply: removed 1 triangles without area and 49999 duplicate triangles";
    assert!(notes.contains(removed), "{notes}");
    assert_eq!(found["points"], 50_000);
    assert_eq!(found["points_at_origin"], 40_000);
    assert_eq!(found["truth_triangles_removed"]["degenerate"], 1);
    assert_eq!(found["truth_triangles_removed"]["duplicate"], 49_999);
    assert_eq!(found["cloud_to_truth"]["hausdorff_mm"], 0.0);
    // The same cloud serves as the truth.
    let (found, notes) = run("scan.ply");
    assert_eq!(notes.matches(dropped).count(), 2, "{notes}");
    assert_eq!(found["truth_points_at_origin"], 40_000);
    assert_eq!(found["coverage"], 1.0);
    let message = complaint(dir, &["invalid.ply", "--truth", "truth.ply"]);
    let says = "invalid.ply: 40000 points, all at (0, 0, 0)";
    assert!(message.contains(says), "{message}");
}
