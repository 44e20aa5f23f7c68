//! Light of projector and lenses: response, contrast, vignetting, defocus, and fringes too fine to
//! resolve. Compared with closed forms and with the slow reference renderer in f64.

use glam::{DVec2, DVec3};
use phasmid::decode::{Decoder, Options};
use phasmid::emulator::render::reference::Reference;
use phasmid::emulator::render::{Renderer, Term};
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::pattern::{Axis, Image, Manifest, Pattern};
use phasmid::profile::{Focus, Profile, Response, Scene, Vignetting};
use rayon::prelude::*;
use std::sync::Arc;

fn bench() -> Profile {
    Profile::load("pmp-bench").unwrap()
}

/// Returns a scene with a plane that faces camera and projector and is fully lit by the projector of
/// [`wide`].
fn wall(z_mm: f64, ambient: f64) -> Scene {
    let text = format!(
        "name = \"wall\"\ndescription = \"\"\nambient = {{ irradiance_w_m2 = {ambient:?} }}\n\
         [[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [0, 0, {z_mm:?}]\nalbedo = 0.8\n"
    );
    Scene::parse(&text, "wall").unwrap()
}

fn pattern_image(pattern: &Pattern, profile: &Profile) -> Arc<PatternImage> {
    Arc::new(PatternImage::new(pattern, &profile.projector, &|_| unreachable!()).unwrap())
}

fn fringe(axis: Axis, period_px: f64, phase_rad: f64) -> Pattern {
    Pattern::Fringe {
        axis,
        period_px,
        phase_rad,
    }
}

fn shot(pattern_image: &Arc<PatternImage>) -> Shot {
    Shot {
        id: 1,
        noise_id: 1,
        pattern_image: Some(pattern_image.clone()),
        light: 0.4,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

/// Returns the profile with all terms that this file tests.
fn everything(mut profile: Profile) -> Profile {
    profile.projector.response = Some(Response::Gamma(1.8));
    profile.projector.contrast_ratio = Some(300.0);
    profile.projector.focus = Some(Focus {
        distance_mm: 900.0,
        aperture_mm: 8.0,
    });
    profile.projector.vignetting = Vignetting {
        natural: true,
        falloff: [-0.1, 0.0, 0.0],
    };
    profile.camera.vignetting = Vignetting {
        natural: true,
        falloff: [-0.2, 0.03, -0.01],
    };
    profile
}

#[test]
fn each_term_agrees_with_the_reference_path() {
    let plain = bench();
    let with = |change: &dyn Fn(&mut Profile)| {
        let mut profile = plain.clone();
        change(&mut profile);
        profile
    };
    let measured = vec![0.0, 0.02, 0.11, 0.3, 0.62, 0.9, 1.0];
    let mut distorted = everything(plain.clone());
    distorted.camera.distortion = [-0.12, 0.05, 8e-4, -5e-4, -0.004];
    distorted.projector.distortion = [-0.05, 0.02, -4e-4, 6e-4, 0.001];
    let whole = everything(plain.clone());
    let profiles = [
        with(&|p| p.projector.response = Some(Response::Table(measured.clone()))),
        with(&|p| p.projector.contrast_ratio = Some(20.0)),
        with(&|p| p.projector.vignetting = whole.projector.vignetting),
        with(&|p| p.camera.vignetting = whole.camera.vignetting),
        with(&|p| p.projector.focus = whole.projector.focus),
        whole.clone(),
        distorted,
    ];
    let gray = Pattern::Gray {
        axis: Axis::X,
        cell_px: 8.0,
        bits: 8,
        bit: 1,
        inverted: false,
    };
    for (i, profile) in profiles.iter().enumerate() {
        for scene in ["plane", "trapezoid"] {
            let scene = Scene::load(scene).unwrap();
            // Blur adds two dimensions that the reference must sample.
            let (rays, step) = match profile.projector.focus {
                Some(_) => (30_000, 4001),
                None => (2584, 977),
            };
            let reference = Reference::new(profile, &scene).unwrap();
            let mut renderer = Renderer::new(profile, &scene, 1).unwrap();
            let truth = renderer.truth(&[]);
            for pattern in [gray.clone(), fringe(Axis::X, 9.2, 0.7), Pattern::Black {}] {
                let pattern_image = pattern_image(&pattern, profile);
                let fast = renderer.expected_dn(&Shot {
                    light: 1.0,
                    ..shot(&pattern_image)
                });
                // Sixteen samples may miss an edge that cuts off only a corner of a pixel.
                let even = |i: usize| {
                    let flags = truth.flags.get(i).copied().unwrap_or(0);
                    flags & (Truth::LIT | Truth::CREASE) == Truth::LIT
                };
                let near = |i: usize| [i.wrapping_sub(1138), i.wrapping_sub(1), i, i + 1, i + 1138];
                let lit: Vec<_> = (0..fast.len())
                    .filter(|&i| near(i).into_iter().all(even))
                    .step_by(step)
                    .collect();
                assert!(lit.len() > 15, "{}", lit.len());
                let worst = lit
                    .par_iter()
                    .map(|&i| {
                        let width = truth.width as usize;
                        let px = DVec2::new((i % width) as f64, (i / width) as f64);
                        let slow = reference.signal_dn(px, &pattern_image, 0.008, rays);
                        (f64::from(fast[i]) - slow).abs()
                    })
                    .reduce(|| 0.0, f64::max);
                // Most of this error is the sampling error of the reference renderer.
                assert!(worst < 0.5, "profile {i}, {pattern:?}: {worst}");
            }
        }
    }
}

#[test]
fn levels_are_those_of_exact_clipping_down_to_pixels_wider_than_a_period() {
    let mut profile = bench();
    profile.camera.sensor.noiseless = true;
    for gamma in [1.0, 2.2] {
        profile.projector.response = (gamma != 1.0).then_some(Response::Gamma(gamma));
        let z = 1000.0;
        let mut renderer = Renderer::new(&profile, &wall(z, 0.0), 1).unwrap();
        let (camera, projector) = (profile.camera.view().lens, profile.projector.view().lens);
        // Camera and projector both see the wall perpendicularly, so every pixel's footprint is a
        // box of this width.
        let width = projector.focal_px.x / camera.focal_px.x;
        let black = profile.camera.sensor.black_level_dn;
        let white = renderer.expected_dn(&shot(&pattern_image(&Pattern::White {}, &profile)));
        for pixels in [0.7, 1.3, 2.1, 3.68, 40.0] {
            let pattern = fringe(Axis::X, pixels * width, 0.4);
            let row = pattern.quantised_row(1920, 8).unwrap();
            let pattern_image = pattern_image(&pattern, &profile);
            let signal = renderer.expected_dn(&shot(&pattern_image));
            let truth = renderer.truth(&[(pattern, shot(&pattern_image))]);
            let (mut compared, mut worst) = (0, 0.0f64);
            for i in 0..signal.len() {
                let lit = Truth::LIT | Truth::CREASE;
                if truth.flags[i] & lit != Truth::LIT {
                    continue;
                }
                assert_eq!(truth.flags[i] & Truth::UNRESOLVED != 0, pixels <= 1.0);
                let u = (i % truth.width as usize) as f64;
                let at_mm = (u - camera.principal_px.x) * z / camera.focal_px.x;
                let x = (at_mm - 400.0) * projector.focal_px.x / z + projector.principal_px.x;
                let (low, high) = (x - width / 2.0, x + width / 2.0);
                if low < 0.0 || high > 1919.0 {
                    continue;
                }
                // Held pixel k covers coordinates from k - 1/2 to k + 1/2.
                let exact = (low.round() as usize..=high.round() as usize)
                    .map(|k| {
                        let part = high.min(k as f64 + 0.5) - low.max(k as f64 - 0.5);
                        part.max(0.0) * (f64::from(row[k]) / 255.0).powf(gamma)
                    })
                    .sum::<f64>()
                    / width;
                let full = f64::from(white[i]) - black;
                let level = (f64::from(signal[i]) - black) / full;
                worst = worst.max(255.0 * (level - exact).abs());
                compared += 1;
            }
            assert!(
                compared > 50_000 && worst < 0.05,
                "{pixels} px a period: {worst}"
            );
        }
    }
}

#[test]
fn natural_vignetting_is_the_fourth_power_of_the_cosine() {
    let signal = |profile: &Profile, scene: &Scene, pattern: &Pattern| {
        let mut renderer = Renderer::new(profile, scene, 1).unwrap();
        let black = profile.camera.sensor.black_level_dn as f32;
        let mut dn = renderer.expected_dn(&shot(&pattern_image(pattern, profile)));
        dn.iter_mut().for_each(|dn| *dn -= black);
        (dn, renderer.truth(&[]))
    };
    let natural = Vignetting {
        natural: true,
        ..Vignetting::default()
    };
    // The camera faces a wall with ambient light only.
    let mut profile = bench();
    profile.camera.vignetting = natural;
    let (seen, truth) = signal(&profile, &wall(700.0, 0.5), &Pattern::Black {});
    let focal = profile.camera.view().lens.focal_px.x;
    let middle = profile.camera.view().lens.principal_px;
    let offset = |i: usize| DVec2::new((i % 1138) as f64, (i / 1138) as f64) - middle;
    let fourth = |tangent: f64| (1.0 + tangent * tangent).powi(-2);
    let center =
        f64::from(seen[244 * 1138 + 568]) / fourth(offset(244 * 1138 + 568).length() / focal);
    let whole = |i: &usize| truth.flags[*i] & Truth::CREASE == 0;
    for i in (0..seen.len()).step_by(101).filter(whole) {
        let expected = center * fourth(offset(i).length() / focal);
        assert!((f64::from(seen[i]) / expected - 1.0).abs() < 1e-5, "{i}");
    }
    assert!(truth.flags.iter().all(|f| f & Truth::SEEN != 0));
    // The projector shows white on a wall that it faces, so that only the angles of the projector's
    // rays matter.
    profile.camera.vignetting = Vignetting::default();
    profile.projector.vignetting = natural;
    let (shown, truth) = signal(&profile, &wall(1000.0, 0.0), &Pattern::White {});
    let lit: Vec<_> = (0..shown.len())
        .filter(|&i| truth.flags[i] & (Truth::LIT | Truth::CREASE) == Truth::LIT)
        .collect();
    let pupil = DVec3::new(400.0, 0.0, 0.0);
    let on_axis = |i: usize| {
        let point = (offset(i) / focal * 1000.0).extend(1000.0);
        let way = point - pupil;
        f64::from(shown[i]) / fourth(way.truncate().length() / way.z)
    };
    let first = on_axis(lit[0]);
    for &i in lit.iter().step_by(37) {
        assert!((on_axis(i) / first - 1.0).abs() < 1e-5, "{i}");
    }
}

#[test]
fn a_fringe_off_the_focus_has_the_contrast_of_the_closed_form() {
    let period = 16.0;
    let modulation = |profile: &Profile, z: f64| {
        let mut renderer = Renderer::new(profile, &wall(z, 0.0), 1).unwrap();
        let sequence: Vec<_> = (0..4)
            .map(|i| {
                let pattern = fringe(Axis::X, period, f64::from(i) * std::f64::consts::FRAC_PI_2);
                let pattern_image = pattern_image(&pattern, profile);
                (pattern, shot(&pattern_image))
            })
            .collect();
        let truth = renderer.truth(&sequence);
        let middle = 244 * 1138 + 569;
        assert!(truth.flags[middle] & Truth::LIT != 0);
        // Average over pixels at all phases within the projector's held pixels.
        let near = &truth.modulation_dn[middle - 40..middle + 40];
        near.iter().map(|&b| f64::from(b)).sum::<f64>() / 80.0
    };
    let sharp = bench();
    let mut soft = bench();
    soft.projector.focus = Some(Focus {
        distance_mm: 1000.0,
        aperture_mm: 9.0,
    });
    for z in [700.0, 850.0, 1000.0, 1200.0, 1500.0] {
        // Similar triangles: the blur disc is the section at depth z of the cone from the aperture
        // to the focused plane.
        let disc_mm = 9.0 * (z - 1000.0f64).abs() / 1000.0;
        let disc_px = disc_mm / z * 1.433 * 1920.0;
        let sigma = disc_px / 4.0;
        let expected = (-2.0 * (std::f64::consts::PI * sigma / period).powi(2)).exp();
        let left = modulation(&soft, z) / modulation(&sharp, z);
        assert!(
            (left - expected).abs() < 1e-4,
            "{z}: {left}, not {expected}"
        );
    }
}

#[test]
fn defocus_leaves_a_sharp_plane_and_its_noise_to_the_byte() {
    let mut profile = bench();
    let scene = wall(1000.0, 0.1);
    let pattern = pattern_image(&fringe(Axis::X, 16.0, 0.0), &profile);
    let sharp = Renderer::new(&profile, &scene, 3)
        .unwrap()
        .expose(&shot(&pattern));
    profile.projector.focus = Some(Focus {
        distance_mm: 1000.0,
        aperture_mm: 30.0,
    });
    let mut renderer = Renderer::new(&profile, &scene, 3).unwrap();
    assert!(renderer.plan().has(Term::ProjectorDefocus));
    assert!(sharp.data == renderer.expose(&shot(&pattern)).data);
}

/// Returns a sequence of twelve steps, a Gray code and its complementary bit, like the bench's
/// sequence but with another period.
fn sequence(period_px: f64, profile: &Profile) -> Manifest {
    let mut manifest = profile.manifest(&profile.sequence[0]);
    let bits = (1920.0 / period_px).log2().ceil() as u32;
    let template = manifest.frame[0].clone();
    let mut frames = Vec::new();
    let mut push = |pattern| {
        let mut frame = template.clone();
        frame.pattern = pattern;
        frames.push(frame);
    };
    for i in 0..12 {
        push(fringe(
            Axis::X,
            period_px,
            f64::from(i) * std::f64::consts::TAU / 12.0,
        ));
    }
    for bit in (0..bits).rev() {
        push(Pattern::Gray {
            axis: Axis::X,
            cell_px: period_px,
            bits,
            bit,
            inverted: false,
        });
    }
    push(Pattern::Gray {
        axis: Axis::X,
        cell_px: period_px / 2.0,
        bits: bits + 1,
        bit: 0,
        inverted: false,
    });
    push(Pattern::White {});
    push(Pattern::Black {});
    manifest.frame = frames;
    manifest
}

#[test]
fn fringes_finer_than_pixels_or_blur_are_unresolved_and_not_valid() {
    let width = bench().projector.view().lens.focal_px.x / bench().camera.view().lens.focal_px.x;
    let mut soft = bench();
    soft.projector.focus = Some(Focus {
        distance_mm: 500.0,
        aperture_mm: 25.0,
    });
    for (profile, light, period, unresolved) in [
        (bench(), 0.4, 2.1 * width, false),
        (bench(), 0.4, 1.0 * width, true),
        (bench(), 0.4, 0.7 * width, true),
        // White saturates; the fringes, which have little contrast, do not.
        (bench(), 2.6, 0.7 * width, true),
        (bench(), 0.4, 0.4 * width, true),
        (soft, 0.4, 16.0, true),
    ] {
        let manifest = &sequence(period, &profile);
        let mut renderer = Renderer::new(&profile, &wall(1000.0, 0.02), 1).unwrap();
        let shots: Vec<_> = (0..)
            .zip(&manifest.frame)
            .map(|(id, frame)| {
                let mut shot = shot(&pattern_image(&frame.pattern, &profile));
                (shot.id, shot.noise_id, shot.light) = (id, id, light);
                (frame.pattern.clone(), shot)
            })
            .collect();
        let truth = renderer.truth(&shots);
        let frames: Vec<_> = shots.iter().map(|(_, s)| renderer.expose(s).data).collect();
        let images: Vec<_> = frames
            .iter()
            .map(|f| Image::new(1138, 489, f.clone()).unwrap())
            .collect();
        let rig = profile.nominal_rig();
        let decoder = Decoder::new(manifest, 1138, 489, Some(&rig), Options::default()).unwrap();
        let decoded = decoder.decode(&images).unwrap();
        let lit = |i: &usize| truth.flags[*i] & (Truth::LIT | Truth::CREASE) == Truth::LIT;
        let lit: Vec<_> = (0..truth.flags.len()).filter(lit).collect();
        assert!(lit.len() > 50_000, "{}", lit.len());
        let told = |i: &&usize| truth.flags[**i] & Truth::UNRESOLVED == 0;
        assert_eq!(
            lit.iter().filter(told).count(),
            if unresolved { 0 } else { lit.len() }
        );
        let map = decoded.x.unwrap();
        let mut counts = [0; 7];
        for &i in &lit {
            counts[map.verdict[i] as usize] += 1;
        }
        let white = frames.iter().map(|f| f[lit[0]]).max();
        assert_eq!(white == Some(255), light > 1.0, "{white:?}");
        if unresolved {
            assert_eq!(counts[0], 0, "{period} px: {counts:?}");
        } else {
            assert!(counts[0] > lit.len() * 9 / 10, "{period} px: {counts:?}");
        }
    }
}
