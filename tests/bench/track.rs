//! Measures the time of each stage of tracking relative to a memory copy of 10,000 points in the
//! same run: this ratio varies less between machines and over time than the time itself.

use glam::{DVec3, Vec3};
use phasmid::decode::Capture;
use phasmid::decode::{Known, check_sequence};
use phasmid::emulator::render;
use phasmid::geometry::shapes::{Torso, torso};
use phasmid::geometry::{Mesh, Pose};
use phasmid::host::track::{
    FitOptions, Measured, ModelOptions, MotionModel, MotionState, MotionTracker, Reference, Region,
    RigidOptions, Sight, SixDof, Snapshots, Start, track_rigid,
};
use phasmid::measure::{OVERLAP_COLUMNS, overlap};
use phasmid::profile::{Profile, Scene};
use phasmid::study::scanned::Stage as Device;
use phasmid::study::timing::Stopwatch;
use std::hint::black_box;
use std::time::Instant;

const POINTS: usize = 10_000;

/// Name of a stage, and the function to time.
type Stage<'a> = (&'static str, Box<dyn FnMut() + 'a>);

fn main() {
    let begin = Instant::now();
    let clock = || begin.elapsed();
    let watch = Stopwatch::new(&clock);
    let skin = patient();
    let region = Region::Box {
        lo: DVec3::new(-200.0, -150.0, 30.0),
        hi: DVec3::new(200.0, 150.0, 200.0),
    };
    let reference = Reference::new(&skin, &region).expect("a region");
    let points = points(&skin);
    let pose = SixDof {
        translation_mm: DVec3::new(2.0, 1.0, -1.0),
        rotation_deg: DVec3::new(0.5, 0.3, -0.4),
    }
    .pose();
    let moved = points.iter().map(|&p| pose.point(p)).collect();
    let (still, displaced) = (
        Measured::isotropic(points.clone(), 0.2),
        Measured::isotropic(moved, 0.2),
    );
    let snapshots = breathing(&skin);
    let tumour = tumour();
    let learn = || MotionModel::new(&snapshots, &tumour, &ModelOptions::default());
    let model = learn().expect("it moves");
    let options = FitOptions::default();
    let tracker = MotionTracker::new(&reference, &model, Pose::IDENTITY, &options).expect("fits");
    let mean = MotionState::mean(&model);
    let warm = tracker.fit(&still, &mean).expect("in sight").state;
    let feet: Vec<_> = points.iter().map(|&p| reference.closest(p)).collect();
    let rigid = RigidOptions::default();
    let near = Start::Near(Pose::IDENTITY);
    let far = Start::Within {
        around: Pose::IDENTITY,
        range_mm: 50.0,
    };
    println!(
        "{} triangles, {} points, {} threads",
        skin.triangles.len(),
        points.len(),
        rayon::current_num_threads()
    );
    println!("{:<48}{:>10}{:>12}{:>10}", "", "ms", "copy ms", "ratio");
    let captured = captured();
    let mut sight = Sight::new("pod", Pose::IDENTITY);
    let mut stages: Vec<Stage<'_>> = vec![
        (
            "check of a pod's frames",
            Box::new(|| {
                check_sequence(
                    &captured.manifest,
                    &captured.images,
                    Known::new(true, captured.calibration.as_ref()),
                )
                .expect("sound");
            }),
        ),
        (
            "check of a pod's frames, and points",
            Box::new(|| {
                let mut measured = Measured::default();
                let doubt = sight.measure(&captured, true, &mut measured, POINTS);
                assert_eq!(doubt.expect("a calibration"), None);
                black_box(measured);
            }),
        ),
        (
            "nearest points, new search, one thread",
            Box::new(|| {
                for &p in &points {
                    black_box(reference.closest(p));
                }
            }),
        ),
        (
            "nearest points, from the last, one thread",
            Box::new(|| {
                for (&p, foot) in points.iter().zip(&feet) {
                    black_box(reference.closest_near(p, foot.triangle));
                }
            }),
        ),
        (
            "six degrees of freedom, from the last pose",
            Box::new(|| {
                black_box(track_rigid(&displaced, &reference, &near, &rigid).expect("in sight"));
            }),
        ),
        (
            "six degrees of freedom, from within 50 mm",
            Box::new(|| {
                black_box(track_rigid(&displaced, &reference, &far, &rigid).expect("in sight"));
            }),
        ),
        (
            "motion, from the mean",
            Box::new(|| {
                black_box(tracker.fit(&still, &mean).expect("in sight"));
            }),
        ),
        (
            "motion, from the last scan",
            Box::new(|| {
                black_box(tracker.fit(&still, &warm).expect("in sight"));
            }),
        ),
        (
            "once: reference surface",
            Box::new(|| {
                black_box(Reference::new(&skin, &region).expect("a region"));
            }),
        ),
        (
            "once: motion model",
            Box::new(|| {
                black_box(learn().expect("it moves"));
            }),
        ),
        (
            "once: Dice's coefficient of a tumour",
            Box::new(|| {
                black_box(overlap(&tumour, &tumour, OVERLAP_COLUMNS).expect("solid"));
            }),
        ),
    ];
    let bytes = POINTS * size_of::<DVec3>();
    for (name, work) in &mut stages {
        let [seconds, copy] = watch.beside_a_copy(bytes, 1.0, work);
        println!(
            "{name:<48}{:>10.2}{:>12.4}{:>10.1}",
            seconds * 1e3,
            copy * 1e3,
            seconds / copy
        );
    }
}

/// Returns a scan by a pod under the ceiling.
fn captured() -> Capture {
    let profile = Profile::load("sgrt-pod").expect("built in");
    let mut scene = Scene::load("torso").expect("built in");
    for object in &mut scene.object {
        object.position_mm[2] += 1400.0;
    }
    let device = Device::new(&profile, &scene, 1, render::Options::default());
    device.expect("a device").scan(0).expect("a scan")
}

/// Returns a supine patient in the room's frame, with the isocentre in the chest.
fn patient() -> Mesh {
    let mut mesh = torso(&Torso {
        seed: 3,
        triangles: 60_000,
        ..Torso::default()
    });
    for v in &mut mesh.vertices {
        *v = DVec3::new(v.x, -v.y, -v.z) - DVec3::new(0.0, 60.0, 120.0);
    }
    mesh
}

/// Returns the centroids of evenly spaced triangles on the front of a mesh, with pseudo-noise of 0.2
/// mm RMS in height.
fn points(mesh: &Mesh) -> Vec<DVec3> {
    let front: Vec<DVec3> = (0..mesh.triangles.len())
        .map(|i| mesh.corners(i).iter().sum::<DVec3>() / 3.0)
        .filter(|p| p.z > 20.0 && p.y.abs() < 170.0)
        .collect();
    (0..POINTS)
        .map(|k| {
            let noise = 0.7 * ((k as f64 * 0.618_033_988_7).fract() - 0.5);
            front[k * front.len() / POINTS] + DVec3::new(0.3 * noise, -0.5 * noise, noise)
        })
        .collect()
}

/// Returns snapshots of breathing, in which chest and abdomen rise one after the other.
fn breathing(skin: &Mesh) -> Snapshots {
    let mut snapshots = Snapshots::default();
    for k in 0..10 {
        let phase = std::f32::consts::TAU * k as f32 / 10.0;
        let (chest, belly) = (1.0 - phase.cos(), 1.0 - (phase - 0.6).cos());
        let rise = |v: &DVec3| {
            let hill = |y: f64| (-((v.y - y) / 80.0).powi(2) / 2.0).exp() as f32;
            Vec3::Z * (2.0 * chest * hill(60.0) + 4.0 * belly * hill(-90.0))
        };
        snapshots
            .skin
            .push(skin.vertices.iter().map(rise).collect());
        let down = Vec3::new(0.5, -6.0, 1.5) * (1.0 - (phase - 0.9).cos());
        snapshots.tumour.push(vec![down; tumour().vertices.len()]);
    }
    snapshots
}

/// Returns a tumour made by the generator of the torso: scaled to 6 % and moved to the tumour's
/// position.
fn tumour() -> Mesh {
    let mut mesh = torso(&Torso {
        triangles: 3000,
        ..Torso::default()
    });
    for v in &mut mesh.vertices {
        *v = *v * 0.06 + DVec3::new(60.0, -20.0, 0.0);
    }
    mesh
}
