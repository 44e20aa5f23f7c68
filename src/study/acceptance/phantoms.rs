//! Bodies whose shape does not determine all motions: flat, sphere, cylinder.

use super::answer::{answered, part, track, worst};
use super::effort::Effort;
use super::known::BAR;
use super::subject::{Body, Subject, time_ns};
use crate::clinic::Pods;
use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_geometry::Pose;
use phasmid_report::lab::{Block, Check, Context, Row, Rows, Section, Settings, Table, Trial};
use phasmid_sgrt::{POINTS, Reference, RigidFit, SixDof};

/// Text above the tables.
const WORDS: &str = "A surface scanner cannot see that a flat board slides or turns in its plane, \
    that a sphere turns about its centre, or that a cylinder slides along its axis or turns about \
    it. A result that does not report this is wrong, whatever its values. The motions that the \
    shape does determine must still be right.";

/// The bodies, and the motions that leave each of them unchanged.
const BODIES: [(Body, &str); 3] = [
    (Body::Flat, "LAT LNG yaw"),
    (Body::Sphere, "pitch roll yaw"),
    (Body::Cylinder, "LNG roll"),
];

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    let one = |(body, _): (Body, &str)| {
        let key = format!("phantoms/{}", body.name());
        Trial::new(key, settings.seed, move |context| {
            moved(context, body, effort)
        })
    };
    BODIES.map(one).into()
}

/// Returns the planned pose, displacements in both directions along motions that the shape determines,
/// and a displacement along motions that it does not determine.
fn displacements(body: Body) -> [SixDof; 4] {
    let six = |t: [f64; 3], r: [f64; 3]| SixDof {
        translation_mm: DVec3::from_array(t),
        rotation_deg: DVec3::from_array(r),
    };
    let [seen, unseen] = match body {
        Body::Sphere => [
            six([5.0, -5.0, 5.0], [0.0; 3]),
            six([0.0; 3], [2.0, -2.0, 2.0]),
        ],
        Body::Cylinder => [
            six([5.0, 0.0, -5.0], [1.0, 0.0, -1.0]),
            six([0.0, 10.0, 0.0], [0.0, 2.0, 0.0]),
        ],
        _ => [
            six([0.0, 0.0, 5.0], [1.0, -1.0, 0.0]),
            six([10.0, -10.0, 0.0], [0.0, 0.0, 2.0]),
        ],
    };
    let back = SixDof {
        translation_mm: -seen.translation_mm,
        rotation_deg: -seen.rotation_deg,
    };
    [SixDof::default(), seen, back, unseen]
}

fn moved(context: &Context<'_>, body: Body, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(body)?;
    let reference = subject.reference()?;
    let poses = displacements(body);
    let scene = subject.on_the_way(&poses);
    let mut pods = Pods::new(&scene, context.seed, &|profile| effort.adapt(profile))?;
    let mut rows = Vec::new();
    for (k, truth) in poses.iter().enumerate() {
        let scan = pods.scan(time_ns(k), true)?;
        let fit = track(&pods.measured(&scan, POINTS), &reference);
        let mut row = Row::new()
            .text("subject", body.name())
            .number("by", k as f64);
        if let Ok(fit) = &fit {
            let [surface, axis] = apart(body, fit, truth, &reference);
            row = row.number("surface_mm", surface).number("axis_deg", axis);
        }
        rows.push(answered(row, None, &fit, truth));
    }
    Ok(rows)
}

/// Compares the tracked surface with the true surface, ignoring motions that leave the body unchanged.
/// Returns the RMS distance in millimetres of the region's vertices, in their tracked position, from the
/// true body in closed form, and the angle in degrees between the tracked and the true axis (for a flat
/// board its normal; 0 for a sphere).
fn apart(body: Body, fit: &RigidFit, truth: &SixDof, reference: &Reference) -> [f64; 2] {
    let body_from_found: Pose = truth.pose().inverse() * fit.room_from_reference;
    let vertices: Vec<DVec3> = reference
        .region_normals()
        .into_iter()
        .map(|(v, _)| reference.vertices()[v as usize])
        .collect();
    // Subtract the error of the mesh itself, a few micrometres, which the tracker does not cause.
    let off = |p: DVec3| body.outside_mm(body_from_found.point(p)) - body.outside_mm(p);
    let squares: f64 = vertices.iter().map(|&p| off(p).powi(2)).sum();
    let axis = match body {
        Body::Cylinder => DVec3::Y,
        _ => DVec3::Z,
    };
    let angle = match body {
        Body::Sphere => 0.0,
        _ => body_from_found
            .direction(axis)
            .cross(axis)
            .length()
            .asin()
            .to_degrees(),
    };
    [(squares / vertices.len().max(1) as f64).sqrt(), angle]
}

fn of<'a>(rows: &'a Rows, body: &'a str) -> impl Iterator<Item = &'a Row> + Clone {
    part(rows, "phantoms").filter(move |row| row.get("subject") == body)
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut table = Table::new(
        "acceptance-phantoms",
        "Bodies at the planned place, displaced in both directions along motions that their shape \
         determines, and along motions that it does not: number of results, of results without a \
         warning, and of results that name other motions than the shape leaves free; worst \
         distance (RMS over the region, mm) and angle (degrees) between the tracked and the true \
         body, which do not depend on the free motions.",
        &[
            "body (free motions)",
            "answers",
            "answers without warning",
            "wrong motions named",
            "distance",
            "angle",
        ],
    );
    for (body, free) in BODIES {
        let all = of(rows, body.name());
        let count = all.clone().count();
        if count == 0 {
            continue;
        }
        table.row([
            format!("{} ({free})", body.name()),
            count.to_string(),
            silent(all.clone()).to_string(),
            others(all.clone(), free).to_string(),
            format!(
                "{:.4}",
                worst(all.clone().map(|row| row.value("surface_mm")))
            ),
            format!("{:.4}", worst(all.map(|row| row.value("axis_deg")))),
        ]);
    }
    Section::new(
        "Flat, sphere and cylinder",
        vec![
            Block::Words(WORDS.to_owned()),
            Block::Table(table),
            Block::Checks(checks(rows)),
        ],
    )
}

fn silent<'a>(rows: impl Iterator<Item = &'a Row>) -> usize {
    rows.filter(|row| row.get("warnings").is_empty()).count()
}

fn others<'a>(rows: impl Iterator<Item = &'a Row>, free: &str) -> usize {
    rows.filter(|row| row.get("free") != free).count()
}

fn checks(rows: &Rows) -> Vec<Check> {
    let all = part(rows, "phantoms");
    if all.clone().next().is_none() {
        return Vec::new();
    }
    let misnamed: usize = BODIES
        .iter()
        .map(|(body, free)| others(of(rows, body.name()), free))
        .sum();
    vec![
        Check::at_most(
            "answers without a warning although the body leaves motions free",
            silent(all.clone()) as f64,
            0.0,
        ),
        Check::at_most(
            "warnings that name a motion which the body does not leave free",
            misnamed as f64,
            0.0,
        ),
        Check::at_most(
            "worst distance between the tracked and the true body, in mm",
            worst(all.clone().map(|row| row.value("surface_mm"))),
            BAR[0],
        ),
        Check::at_most(
            "worst angle between the tracked and the true axis, in degrees",
            worst(all.map(|row| row.value("axis_deg"))),
            BAR[1],
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_motions_leave_a_body_as_it_is() {
        for (body, free) in BODIES {
            let [_, seen, _, unseen] = displacements(body).map(|six| six.pose());
            let on = Subject::new(body).unwrap().reference().unwrap();
            let most = |pose: &Pose| {
                let all = on.region_normals();
                let off = all.iter().map(|(v, _)| {
                    let p = on.vertices()[*v as usize];
                    (body.outside_mm(pose.point(p)) - body.outside_mm(p)).abs()
                });
                off.fold(0.0, f64::max)
            };
            assert!(most(&unseen) < 1e-9, "{free}: {}", most(&unseen));
            assert!(most(&seen) > 4.0, "{}", body.name());
        }
    }
}
