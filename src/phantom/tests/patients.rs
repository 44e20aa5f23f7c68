//! Compares the built-in patients with surveys and published breathing data.

use super::*;
use phasmid_geometry::shapes::check::closed;

/// Largest distance between two of the ten positions of a point.
fn excursion(phantom: &Phantom, x: DVec3) -> f64 {
    let at: Vec<DVec3> = (0..PHASES)
        .map(|k| phantom.displacement(x, &phantom.planning_phase(k)))
        .collect();
    let pairs = at
        .iter()
        .flat_map(|a| at.iter().map(move |b| (*a - *b).length()));
    pairs.fold(0.0, f64::max)
}

/// Compares sizes with the surveys, and motion with the literature cited in [`breathing`] and
/// [`outline`].
#[test]
fn patients_match_surveys_and_literature() {
    let mut count = 0;
    for phantom in all() {
        count += 1;
        let p = phantom.patient();
        let name = &p.name;
        let skin = phantom.skin(12_000).unwrap();
        let litres = closed(&skin) * 1e-6;
        // The phantom contains trunk, neck and the upper ends of the thighs.
        let share = litres / p.mass_kg;
        assert!((0.48..0.66).contains(&share), "{name}: {share} of the mass");

        let around = |h: f64| {
            let z = h * p.stature_mm;
            let radius = |angle: f64| phantom.skin.radius(angle, z);
            let half = std::f64::consts::FRAC_PI_2;
            (
                radius(0.0) + radius(2.0 * half),
                radius(half) + radius(-half),
            )
        };
        let (breadth, depth) = around(0.04);
        let index = p.body_mass_index();
        if p.age_years > 18 {
            // Breadths of 250 to 380 mm and depths of 180 to 310 mm are the 1st to 99th percentiles of
            // soldiers; a body with a mass index of 40 exceeds them.
            let most = if index > 35.0 { 430.0 } else { 380.0 };
            assert!((240.0..most).contains(&breadth), "{name}: {breadth} broad");
            let most = if index > 35.0 { 370.0 } else { 320.0 };
            assert!((170.0..most).contains(&depth), "{name}: {depth} deep");
        } else {
            assert!((180.0..250.0).contains(&breadth), "{name}: {breadth} broad");
            assert!((130.0..200.0).contains(&depth), "{name}: {depth} deep");
        }
        assert!(phantom.skin.layer_mm() > 1.5 && phantom.skin.layer_mm() < 70.0);

        // The whole tumour is in the lung; since tissue moves with it, this holds at every phase.
        let organs = phantom.modes.organs();
        assert_eq!(phantom.tumour.out_of_lobe(p.tumour.lobe, organs), None);

        // Front of the abdomen: 1 to 20 mm; tumours within 30 mm, in upper lobes within 8.
        let front = |h: f64| {
            let z = h * p.stature_mm;
            phantom.skin.point(-std::f64::consts::FRAC_PI_2, z) - phantom.isocentre
        };
        let (abdomen, chest) = (
            excursion(&phantom, front(-0.06)),
            excursion(&phantom, front(0.03)),
        );
        assert!((2.0..20.0).contains(&abdomen), "{name}: abdomen {abdomen}");
        assert!((0.5..8.0).contains(&chest), "{name}: chest {chest}");
        let tumour = excursion(&phantom, DVec3::ZERO);
        let most = match p.tumour.lobe {
            Lobe::RightUpper | Lobe::LeftUpper => 8.0,
            Lobe::RightMiddle => 16.0,
            Lobe::RightLower | Lobe::LeftLower => 30.0,
        };
        assert!((0.5..most).contains(&tumour), "{name}: tumour {tumour}");
        let back = phantom
            .skin
            .point(std::f64::consts::FRAC_PI_2, 0.03 * p.stature_mm);
        assert!(
            excursion(&phantom, back - phantom.isocentre) < 1e-9,
            "{name}: on the couch"
        );
    }
    assert_eq!(count, 15);
}

/// Hysteresis: the distance between the tumour's positions on the way in and out, at equal weights
/// of the diaphragm mode (its own loop) and of the abdomen mode, whose lag is 0.
#[test]
fn tumours_go_on_loops_of_published_width() {
    let mut wide = 0;
    for phantom in all() {
        let (name, breathing) = (&phantom.patient.name, &phantom.patient.breathing);
        let apart = |mode: usize, top: f64| {
            let at = |phase: f64| {
                let weights_mm = phantom.course.mean(phase);
                let state = State {
                    weights_mm,
                    ..State::REFERENCE
                };
                let gone = phantom.displacement(DVec3::ZERO, &state);
                (weights_mm[mode], gone)
            };
            let apart = (1..50).map(|i| {
                let ((a, out), (b, in_)) =
                    (at(top + 0.01 * f64::from(i)), at(top - 0.01 * f64::from(i)));
                assert!((a - b).abs() < 1e-9);
                (out - in_).length()
            });
            apart.fold(0.0, f64::max)
        };
        // Seppenwoolde et al. 2002: hysteresis of 1 to 5 mm in 10 of 21 tumours.
        let own = apart(DIAPHRAGM, breathing.diaphragm_lag);
        assert!((0.1..5.0).contains(&own), "{name}: {own}");
        wide += usize::from(own > 1.0);
        let beside_skin = apart(ABDOMEN, 0.0);
        assert!((0.3..6.0).contains(&beside_skin), "{name}: {beside_skin}");
    }
    assert!((4..=11).contains(&wide), "{wide} of 15 beyond 1 mm");
}

/// Compares the volume of both lungs, found by counting points, with the sum of functional residual
/// capacity and tissue in ICRP 89.
#[test]
fn lung_volumes_match_published_values() {
    for (name, litres) in [
        ("p01-woman-mean", 2.2..4.2),
        ("p02-man-mean", 3.0..5.2),
        ("p07-child", 0.9..2.0),
    ] {
        let phantom = one(name);
        let step = 4.0;
        let mut count = 0.0;
        for i in -40..40 {
            for j in -40..40 {
                for k in -40..70 {
                    let body = DVec3::new(f64::from(i), f64::from(j), f64::from(k)) * step;
                    if phantom.modes.organs().lungs(body) < 0.0 {
                        assert!(phantom.skin.outside(body) < -8.0, "{name}: {body}");
                        count += step * step * step * 1e-6;
                    }
                }
            }
        }
        assert!(litres.contains(&count), "{name}: {count} l");
    }
}
