//! Displacement, its gradient and inverse, the phases, skin and tumour in motion.

use super::*;
use phasmid_geometry::shapes::check::closed;

#[test]
fn motion_gradient_matches_finite_differences() {
    let phantom = one("p14-man-deep");
    for state in [
        phantom.planning_phase(0),
        phantom.state(Day::Treatment, 11.0),
    ] {
        for x in places(&phantom, 300) {
            let gradient = phantom.gradient(x, &state);
            let step = 1e-4;
            for (j, axis) in DVec3::AXES.into_iter().enumerate() {
                let at = |side: f64| phantom.displacement(x + axis * side * step, &state);
                let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
                let off = (gradient.col(j) - difference).length();
                assert!(off < 1e-7, "{x}, {j}: {off}");
            }
        }
    }
}

/// Tests states and points that are not on the lattice of `Modes::least_determinant`.
#[test]
fn motion_does_not_fold_tissue() {
    for phantom in all() {
        let bounds = phantom.weight_bounds_mm();
        let lattice = phantom.modes.least_determinant(&bounds);
        assert!(lattice > checks::LEAST_DETERMINANT, "{lattice}");
        let draws = random::Draws::new(2, 2);
        let mut least = f64::MAX;
        for (i, x) in places(&phantom, 6000).into_iter().enumerate() {
            // Alternate between corners of the ranges and values in between.
            let weights_mm = std::array::from_fn(|k| {
                let share = draws.unit((i * MODES + k) as i64);
                let share = if i.is_multiple_of(2) {
                    share.round()
                } else {
                    share
                };
                bounds[k][0] + share * (bounds[k][1] - bounds[k][0])
            });
            let state = State {
                weights_mm,
                ..State::REFERENCE
            };
            let gradient = phantom.gradient(x, &state);
            least = least.min((DMat3::IDENTITY + gradient).determinant());
        }
        let name = &phantom.patient.name;
        assert!(
            least > 0.5 * lattice.min(0.8),
            "{name}: {least}, lattice {lattice}"
        );
        assert!(least < 1.0, "{name} moves");
    }
}

#[test]
fn inverse_motion_returns_to_the_start() {
    for name in ["p14-man-deep", "p15-woman-restless", "p07-child"] {
        let phantom = one(name);
        for state in states(&phantom) {
            for x in places(&phantom, 60) {
                let now = phantom.place(x, &state);
                let back = phantom.origin(now, &state);
                assert!((back - x).length() < 1e-8, "{name}: {x} {back}");
                assert!((phantom.place(back, &state) - now).length() < 1e-9);
            }
        }
    }
}

#[test]
fn motion_is_zero_at_the_reference_phase() {
    for phantom in all() {
        let state = phantom.planning_phase(REFERENCE_PHASE);
        assert!(state.weights_mm.iter().all(|w| w.abs() < 1e-12));
        let target = phantom.target(&State::REFERENCE);
        assert!(
            DVec3::from(target.centroid_mm).length() < 1e-9,
            "the isocentre"
        );
        let ball = std::f64::consts::PI / 6.0 * phantom.patient.tumour.diameter_mm.powi(3);
        assert!((target.volume_mm3 / ball - 1.0).abs() < 1e-12);
    }
}

#[test]
fn ten_phases_are_moments_of_the_mean_cycle() {
    for phantom in all() {
        let period = phantom.patient.breathing.period_s;
        for tenth in 0..PHASES {
            let phase = phantom.planning_phase(tenth);
            let moment = phantom.state(Day::Planning, (7.0 + tenth as f64 / 10.0) * period);
            for k in 0..MODES {
                let off = phase.weights_mm[k] - moment.weights_mm[k];
                assert!(off.abs() < 1e-11, "{tenth} {k}: {off}");
            }
            let turn = (phase.phase - moment.phase).abs();
            assert!(turn.min(1.0 - turn) < 1e-12);
        }
    }
}

#[test]
fn the_skin_is_a_blend_of_its_keys() {
    let phantom = one("p15-woman-restless");
    let keys = phantom.skin_keys(3000).unwrap();
    for key in &keys {
        closed(key);
        assert_eq!(key.triangles, keys[0].triangles);
    }
    for state in states(&phantom) {
        let weights = phantom.skin_weights(&state);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for v in (0..keys[0].vertices.len()).step_by(7) {
            let blend: DVec3 = (0..4).map(|k| keys[k].vertices[v] * weights[k]).sum();
            let place = phantom.place(keys[0].vertices[v], &state);
            let off = (state.setup.point(blend) - place).length();
            assert!(off < 1e-9, "{off}: inner modes move the skin");
        }
    }
}

/// Mesh and quadrature are independent ways to compute volume and centroid.
#[test]
fn the_target_is_that_of_its_deformed_mesh() {
    let phantom = one("p14-man-deep");
    for state in [
        phantom.planning_phase(1),
        phantom.state(Day::Treatment, 5.0),
    ] {
        let target = phantom.target(&state);
        let of_mesh = |level| {
            let mesh = phantom.tumour_mesh(&state, level);
            let volume = closed(&mesh);
            let moment: DVec3 = (0..mesh.triangles.len())
                .map(|i| {
                    let [a, b, c] = mesh.corners(i);
                    (a + b + c) * (a.dot(b.cross(c)) / 24.0)
                })
                .sum();
            (volume, moment / volume)
        };
        let ((v3, c3), (v4, c4)) = (of_mesh(3), of_mesh(4));
        // The chord error decreases by a factor of four from level to level, so extrapolation removes
        // it.
        let volume = v4 + (v4 - v3) / 3.0;
        let centroid = c4 + (c4 - c3) / 3.0;
        assert!((volume / target.volume_mm3 - 1.0).abs() < 1e-4, "{volume}");
        let off = (centroid - DVec3::from(target.centroid_mm)).length();
        assert!(off < 1e-3, "{off}");
    }
}

#[test]
fn the_same_seed_is_the_same_patient_at_any_moment() {
    let (a, b) = (one("p13-man-shallow"), one("p13-man-shallow"));
    let times = [1000.0, 0.1, -3.0, 77.7, 0.1];
    let of = |p: &Phantom, t: f64| {
        (
            p.state(Day::Treatment, t),
            p.target(&p.state(Day::Treatment, t)),
        )
    };
    for t in times {
        assert_eq!(of(&a, t), of(&b, t));
    }
    assert_eq!(a.skin(2000).unwrap(), b.skin(2000).unwrap());
    let mut other = a.patient().clone();
    other.seed += 1;
    let other = Phantom::new(&other);
    assert_ne!(other.skin(2000).unwrap(), a.skin(2000).unwrap());
    assert_ne!(
        other.state(Day::Treatment, 50.0),
        a.state(Day::Treatment, 50.0)
    );
}
