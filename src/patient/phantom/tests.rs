//! What the parts give together, and what holds of all patients that ship.

use super::*;
use crate::geometry::shapes::check::closed;

/// Every moment that is asked about: phases of planning, and a minute of the treatment.
fn states(phantom: &Phantom) -> Vec<State> {
    let planned = (0..PHASES).map(|k| phantom.planning_phase(k));
    let treated = (0..20).map(|i| phantom.state(Day::Treatment, 3.1 * f64::from(i)));
    planned.chain(treated).collect()
}

fn all() -> impl Iterator<Item = Phantom> {
    patient_names().map(|name| Phantom::new(&Patient::load(name).unwrap()))
}

fn one(name: &str) -> Phantom {
    Phantom::new(&Patient::load(name).unwrap())
}

/// Places all over the body, in the patient frame.
fn places(phantom: &Phantom, count: i64) -> Vec<DVec3> {
    let draws = random::Draws::new(9, 9);
    let stature = phantom.patient.stature_mm;
    (0..count)
        .map(|i| {
            let [u, v, w] = [0, 1, 2].map(|k| draws.even(3 * i + k));
            DVec3::new(190.0 * u, 150.0 * v, (0.2 * w - 0.01) * stature) - phantom.isocentre
        })
        .collect()
}

#[test]
fn the_gradient_is_that_of_differences() {
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

/// Between states that the lattice of the check does not have, at places that it does not have.
#[test]
fn nothing_folds_over() {
    for phantom in all() {
        let bounds = phantom.weight_bounds_mm();
        let lattice = phantom.modes.least_determinant(&bounds);
        assert!(lattice > checks::LEAST_DETERMINANT, "{lattice}");
        let draws = random::Draws::new(2, 2);
        let mut least = f64::MAX;
        for (i, x) in places(&phantom, 6000).into_iter().enumerate() {
            // Corners of the ranges and what is between them.
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
fn the_inverse_takes_back() {
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
fn at_the_reference_phase_nothing_has_moved() {
    for phantom in all() {
        let state = phantom.planning_phase(REFERENCE_PHASE);
        assert!(state.weights_mm.iter().all(|w| w.abs() < 1e-12));
        let target = phantom.target(&State::REFERENCE);
        assert!(target.centroid_mm.length() < 1e-9, "the isocentre");
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

/// Mesh and quadrature are two ways to volume and centroid.
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
        // The chords' part falls by four from level to level: extrapolated, it is gone.
        let volume = v4 + (v4 - v3) / 3.0;
        let centroid = c4 + (c4 - c3) / 3.0;
        assert!((volume / target.volume_mm3 - 1.0).abs() < 1e-4, "{volume}");
        let off = (centroid - target.centroid_mm).length();
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

/// How far a point goes over the ten phases: the largest distance between two of them.
fn excursion(phantom: &Phantom, x: DVec3) -> f64 {
    let at: Vec<DVec3> = (0..PHASES)
        .map(|k| phantom.displacement(x, &phantom.planning_phase(k)))
        .collect();
    let pairs = at
        .iter()
        .flat_map(|a| at.iter().map(move |b| (*a - *b).length()));
    pairs.fold(0.0, f64::max)
}

/// Sizes by the surveys, motion by the literature that [`breathing`] and [`outline`] name.
#[test]
fn the_patients_are_plausible() {
    let mut count = 0;
    for phantom in all() {
        count += 1;
        let p = phantom.patient();
        let name = &p.name;
        let skin = phantom.skin(12_000).unwrap();
        let litres = closed(&skin) * 1e-6;
        // Trunk, neck and the upper ends of the thighs.
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
            // Breadth 250 to 380 mm and depth 180 to 310 mm hold the 1st to the 99th of a hundred
            // soldiers; a mass index of 40 is beyond them.
            let most = if index > 35.0 { 430.0 } else { 380.0 };
            assert!((240.0..most).contains(&breadth), "{name}: {breadth} broad");
            let most = if index > 35.0 { 370.0 } else { 320.0 };
            assert!((170.0..most).contains(&depth), "{name}: {depth} deep");
        } else {
            assert!((180.0..250.0).contains(&breadth), "{name}: {breadth} broad");
            assert!((130.0..200.0).contains(&depth), "{name}: {depth} deep");
        }
        assert!(phantom.skin.layer_mm() > 1.5 && phantom.skin.layer_mm() < 70.0);

        // The whole tumour is in the lung at every phase: its tissue does not leave its lobe.
        let organs = phantom.modes.organs();
        assert_eq!(organs.out_of_lobe(p.tumour.lobe, &phantom.tumour), None);

        // Skin: 1 to 20 mm, the abdomen's front; tumours within 30 mm, upper lobes' within 8.
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

/// Ways in and out: the tumour's own, apart where the diaphragm is at the same height, and the
/// tumour's beside the abdomen's, which nothing lags before.
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

/// Volume of both lungs by counting, within ICRP 89's functional residual capacity and tissue.
#[test]
fn lungs_hold_what_lungs_hold() {
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

#[test]
fn a_ct_shows_air_skin_lung_and_tumour() {
    let phantom = one("p02-man-mean");
    for state in [State::REFERENCE, phantom.state(Day::Treatment, 3.0)] {
        let at = |x: DVec3| phantom.hounsfield(phantom.place(x, &state), &state);
        assert_eq!(at(DVec3::new(0.0, -400.0, 0.0)), -1000.0);
        assert!((at(DVec3::ZERO) - 38.0).abs() < 1e-9, "tumour");
        let skin = phantom.skin(3000).unwrap();
        for v in skin.vertices.iter().step_by(41) {
            assert!((at(*v) + 500.0).abs() < 1e-3, "{v}: {}", at(*v));
        }
        let beside = DVec3::new(0.0, 0.0, -45.0);
        assert!(phantom.lobe(beside).is_some());
        let lung = at(beside);
        assert!((-900.0..-650.0).contains(&lung), "{lung}");
    }
    // Inhaling thins the lung.
    let beside = DVec3::new(0.0, 0.0, -45.0);
    let [out, in_] = [5, 0].map(|tenth| {
        let state = phantom.planning_phase(tenth);
        phantom.hounsfield(phantom.place(beside, &state), &state)
    });
    assert!((out + 750.0).abs() < 1e-9 && in_ < out - 5.0, "{out} {in_}");
}

#[test]
fn a_planning_folder_says_what_the_phantom_does() {
    let dir = tempfile::tempdir().unwrap();
    let phantom = one("p07-child");
    let folder = dir.path().join("plan");
    phantom.export_planning(&folder, 12.0, true).unwrap();
    let skin = Mesh::read(&folder.join("skin.ply")).unwrap();
    assert_eq!(skin, phantom.skin(SKIN_TRIANGLES).unwrap());
    closed(&Mesh::read(&folder.join("tumour.ply")).unwrap());
    let text = std::fs::read_to_string(folder.join("planning.toml")).unwrap();
    let plan: toml::Table = text.parse().unwrap();
    assert_eq!(plan["reference_phase"].as_integer(), Some(50));
    assert_eq!(plan["phase"].as_array().unwrap().len(), PHASES);

    let bytes = std::fs::read(folder.join("dvf_10.mha")).unwrap();
    let mark = b"ElementDataFile = LOCAL\n";
    let start = bytes.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len();
    let header = String::from_utf8(bytes[..start].to_vec()).unwrap();
    let field = |name: &str| -> Vec<f64> {
        let line = header.lines().find(|l| l.starts_with(name)).unwrap();
        let values = line.split(" = ").nth(1).unwrap();
        values.split(' ').map(|v| v.parse().unwrap()).collect()
    };
    let size: Vec<usize> = field("DimSize").iter().map(|&n| n as usize).collect();
    let voxels = size.iter().product::<usize>();
    assert_eq!(bytes.len(), start + 12 * voxels);
    let origin = DVec3::from_slice(&field("Offset"));
    let state = phantom.planning_phase(1);
    for index in (0..voxels).step_by(97) {
        let [i, j, k] = [
            index % size[0],
            index / size[0] % size[1],
            index / size[0] / size[1],
        ];
        let x = origin + 12.0 * DVec3::new(i as f64, j as f64, k as f64);
        let wanted = phantom.displacement(x, &state);
        let at = start + 12 * index;
        let number = |c: usize| {
            f64::from(f32::from_le_bytes(
                bytes[at + 4 * c..][..4].try_into().unwrap(),
            ))
        };
        let found = DVec3::new(number(0), number(1), number(2));
        assert!((found - wanted).length() < 1e-5, "{index}");
    }
    let ct = std::fs::read(folder.join("ct_50.mha")).unwrap();
    assert!(ct.len() > 2 * voxels);
    let words = phantom
        .export_planning(&folder, 0.1, false)
        .unwrap_err()
        .to_string();
    assert!(words.contains("0.1; allowed: 1 to 20"), "{words}");
    assert!(phantom.skin(10).is_err());
}

#[test]
fn what_cannot_be_a_patient_is_named() {
    let text = include_str!("../../../device-profiles/patients/p01-woman-mean.toml");
    for (from, to, words) in [
        (
            "mass_kg = 65.0",
            "mass_kg = 180.0",
            "mass_kg: 180 for 1630 mm; allowed: ",
        ),
        (
            "stature_mm = 1630.0",
            "stature_mm = nan",
            "stature_mm: NaN; allowed: 1000 to 2100",
        ),
        (
            "period_s = 3.9",
            "period_s = 0.0",
            "breathing.period_s: 0; allowed: 1.5 to 12",
        ),
        (
            "diameter_mm = 26.0",
            "diameter_mm = 70.0",
            "tumour: a tumour that is ",
        ),
        (
            "roughness = 0.22",
            "roughness = 0.22\noffset_mm = [0, 0, 60]",
            "another lobe (RightUpper)",
        ),
        (
            "fitzpatrick = 2",
            "fitzpatrick = 7",
            "skin.fitzpatrick: 7; allowed: 1 to 6",
        ),
        (
            "sex = \"female\"",
            "sex = \"other\"",
            "unknown variant `other`",
        ),
        ("[skin]", "[skin]\ncolour = 3", "unknown field `colour`"),
    ] {
        assert!(text.contains(from), "{from}");
        let found = Patient::parse(&text.replace(from, to), "file.toml").unwrap_err();
        let found = found.to_string();
        assert!(
            found.starts_with("file.toml:") && found.contains(words),
            "{found}"
        );
    }
    // Each by itself is allowed; together they squeeze.
    let mad = text
        .replace("diaphragm_mm = 13.0", "diaphragm_mm = 35.0")
        .replace("amplitude = 1.1", "amplitude = 2.0")
        .replace("amplitude_sd = 0.12", "amplitude_sd = 0.3");
    let found = Patient::parse(&mad, "file.toml").unwrap_err().to_string();
    assert!(
        found.contains("breathing: motion that squeezes tissue to"),
        "{found}"
    );
    let absent = Patient::load("p99").unwrap_err();
    assert_eq!(absent.exit_code(), 2);
}

#[test]
fn a_patient_is_written_as_it_is_read() {
    for name in patient_names() {
        let patient = Patient::load(name).unwrap();
        assert_eq!(patient.name, name);
        let text = toml::to_string(&patient).unwrap();
        assert_eq!(Patient::parse(&text, "again").unwrap(), patient);
    }
}
