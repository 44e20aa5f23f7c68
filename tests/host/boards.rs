//! Boards in scenes, compared with counted rays and with the reference renderer.

use crate::photometry::{dn_per_irradiance, scene};
use glam::{DVec2, DVec3};
use phasmid::emulator::render::reference::Reference;
use phasmid::emulator::render::{Options, Renderer, Term};
use phasmid::emulator::{PatternImage, Shot};
use phasmid::geometry::Board;
use phasmid::pattern::Pattern;
use phasmid::profile::{Profile, Scene, Shape};
use std::path::Path;
use std::sync::Arc;

const DOTS: &str = "pattern = \"dots\", columns = 25, rows = 19, pitch_mm = 24.0, dot_mm = 10.0, \
                    marker_mm = 20.0";
const CHESS: &str = "pattern = \"chess\", columns = 9, rows = 6, pitch_mm = 50.0";
/// A board with a pitch of 1.5 pixels.
const FINE: &str = "pattern = \"dots\", columns = 99, rows = 99, pitch_mm = 2.5, dot_mm = 1.0, \
                    marker_mm = 2.0";

fn before(board: &str, more: &str) -> Scene {
    let text = format!(
        "ambient = {{ irradiance_w_m2 = 0.3 }}\n[[object]]\n\
         shape = {{ kind = \"board\", board = {{ {board} }}, ink = 0.1 }}\nalbedo = 0.8\n{more}\n"
    );
    scene(&text, Path::new(""))
}

fn shot(pattern_image: Option<PatternImage>) -> Shot {
    Shot {
        pattern_image: pattern_image.map(Arc::new),
        light: 1.0,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

fn board(scene: &Scene) -> Board {
    match scene.object[0].shape {
        Shape::Board { board, .. } => board,
        _ => panic!("no board"),
    }
}

/// Returns whether there is ink at a position, by testing all these points of the board.
fn is_ink(board: &Board, points: &[[u32; 2]], p: DVec2) -> bool {
    let pitch = board.pitch_mm();
    match board {
        Board::Dots { .. } => points
            .iter()
            .any(|&i| p.distance(board.point(i)) <= board.radius_mm(i)),
        // At a corner with an even sum of column and row, the upper left and lower right squares
        // are dark.
        Board::Chess { .. } => points
            .iter()
            .map(|&i| (i, p - board.point(i)))
            .filter(|(_, off)| off.abs().cmple(DVec2::splat(pitch)).all())
            .any(|([column, row], off)| (column + row).is_multiple_of(2) == (off.x * off.y > 0.0)),
    }
}

/// Returns the intersection of a pixel's ray with the board's plane, in the board's own frame.
fn meets(profile: &Profile, scene: &Scene, px: DVec2) -> DVec2 {
    let object = &scene.object[0];
    let pose = scene.rig_from_object(object).inverse();
    let (o, d) = (
        pose.translation_mm,
        pose.direction(profile.camera.view().ray(px)),
    );
    (o - d * (o.z / d.z)).truncate() / object.scale
}

#[test]
fn ink_of_a_pixel_matches_4096_rays() {
    for (name, pattern, place) in [
        (
            "pmp-bench",
            DOTS,
            "position_mm = [10, -5, 1000]\nrotation_deg = [20, -35, 15]",
        ),
        (
            "pmp-bench",
            DOTS,
            "position_mm = [0, 0, 1000]\nrotation_deg = [0, 60, 0]",
        ),
        (
            "pmp-bench",
            CHESS,
            "position_mm = [0, 0, 900]\nrotation_deg = [40, 30, 5]",
        ),
        ("pmp-bench", FINE, "position_mm = [0, 0, 1000]\nscale = 1.5"),
    ] {
        let profile = Profile::load(name).unwrap();
        let scene = before(pattern, place);
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        assert!(renderer.plan().has(Term::AlbedoMaps));
        let found = renderer.expected_dn(&shot(None));
        let black = profile.camera.sensor.black_level_dn;
        let white = 0.8 * 0.3 * dn_per_irradiance(&profile, 8e-3);
        let (board, sheet) = (board(&scene), board(&scene).sheet_mm());
        let (mut worst, mut edges, mut off) = (0.0f64, 0, 0);
        for i in (0..found.len()).step_by(173) {
            let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
            let middle = meets(&profile, &scene, px);
            if middle
                .abs()
                .cmpgt(sheet / 2.0 - board.pitch_mm() / 4.0)
                .any()
            {
                continue;
            }
            let near = |index: &[u32; 2]| {
                board.point(*index).distance(middle) <= board.radius_mm(*index) + 8.0
            };
            let is_dots = matches!(board, Board::Dots { .. });
            let near: Vec<[u32; 2]> = board.indices().filter(|i| !is_dots || near(i)).collect();
            if near.is_empty() {
                assert!((f64::from(found[i]) - black - white).abs() < 1e-3 * white);
                continue;
            }
            let mut inked = 0;
            for k in 0..4096 {
                let inside = DVec2::new(f64::from(k % 64) + 0.5, f64::from(k / 64) + 0.5);
                let p = meets(&profile, &scene, px + inside / 64.0 - 0.5);
                inked += u32::from(is_ink(&board, &near, p));
            }
            edges += u32::from(inked % 4096 != 0);
            let exact = black + white * (1.0 - 0.9 * f64::from(inked) / 4096.0);
            let error = (f64::from(found[i]) - exact).abs() / white;
            // At the edge of the projector's field, a pixel is the mean of sixteen samples.
            if error < 8e-3 {
                worst = worst.max(error);
            } else {
                off += 1;
                assert!(error < 4e-2, "{px}: {error}");
            }
        }
        println!("{pattern}: {worst:.1e} of white, {edges} edges, {off} off");
        // An edge parallel to the rows of rays is located only to half a row.
        assert!(off <= 3 && edges > 15, "{off}, {edges}");
    }
}

/// A gradient of the light within a pixel shifts an outline by a twelfth of the gradient. Counting
/// rays reproduces this shift; a renderer with one light level per pixel would not.
#[test]
fn light_varies_within_the_pixels_of_an_outline() {
    let profile = Profile::load("pmp-bench").unwrap();
    let place = "position_mm = [60, -30, 1000]\nrotation_deg = [35, -30, 20]";
    let printed = before(DOTS, place);
    let mut blank = printed.clone();
    if let Shape::Board { ink, .. } = &mut blank.object[0].shape {
        *ink = 1.0;
    }
    let dn = |scene: &Scene| {
        let mut renderer = Renderer::new(&profile, scene, 1).unwrap();
        let pattern_image =
            |pattern| PatternImage::new(pattern, &profile.projector, &|_| unreachable!()).unwrap();
        let mut dn = |pattern_image| {
            let short = Shot {
                exposure_ns: 2_000_000,
                ..shot(pattern_image)
            };
            renderer.expected_dn(&short)
        };
        let white = dn(Some(pattern_image(&Pattern::White {})));
        let black = dn(None);
        white
            .iter()
            .zip(&black)
            .map(|(w, b)| f64::from(w - b))
            .collect::<Vec<_>>()
    };
    let (found, paper) = (dn(&printed), dn(&blank));
    let board = board(&printed);
    let board_from_rig = printed.rig_from_object(&printed.object[0]).inverse();
    let pupil = board_from_rig.point(profile.projector.view().center());
    // On a plane, the cosine is the plane's distance divided by the point's distance.
    let light = |p: DVec2| pupil.distance(p.extend(0.0)).powi(-3);
    let (mut even, mut sloped, mut edges) = (0.0, 0.0, 0);
    for i in (0..found.len()).step_by(211) {
        let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
        let middle = meets(&profile, &printed, px);
        let near = |index: &[u32; 2]| {
            (board.point(*index).distance(middle) - board.radius_mm(*index)).abs() <= 2.0
        };
        let near: Vec<[u32; 2]> = board.indices().filter(near).collect();
        if near.is_empty() || !(paper[i] > 5.0) {
            continue;
        }
        let (mut share, mut lit, mut total) = (0.0, 0.0, 0.0);
        for k in 0..1 << 18 {
            let inside = DVec2::new(f64::from(k % 512) + 0.5, f64::from(k / 512) + 0.5);
            let p = meets(&profile, &printed, px + inside / 512.0 - 0.5);
            let albedo = if is_ink(&board, &near, p) { 0.1 } else { 1.0 };
            share += albedo;
            lit += albedo * light(p);
            total += light(p);
        }
        if share > 0.95 * f64::from(1 << 18) || share < 0.15 * f64::from(1 << 18) {
            continue;
        }
        edges += 1;
        let error = found[i] / paper[i];
        even += (error - share / f64::from(1 << 18)).powi(2);
        sloped += (error - lit / total).powi(2);
    }
    println!(
        "{edges} edges: {:.1e} off, {:.1e} were the light even",
        (sloped / f64::from(edges)).sqrt(),
        (even / f64::from(edges)).sqrt()
    );
    assert!(edges > 20 && sloped < 0.2 * even, "{sloped} {even}");
}

#[test]
fn board_agrees_with_the_reference_path() {
    let profile = Profile::load("pmp-real").unwrap();
    let level = (1 << profile.projector.bits) - 1;
    for pattern in [DOTS, CHESS] {
        let more = "position_mm = [-20, 5, 1000]\nrotation_deg = [15, -25, 5]\n\
                    specular = { f0 = 0.03, roughness = 0.5 }";
        let mut scene = before(pattern, more);
        scene.ambient.irradiance_w_m2 = 0.05;
        let mut profile = profile.clone();
        // The closed form models neither rays through the whole pupil nor glare.
        profile.camera.focus_mm = None;
        profile.camera.glare = None;
        profile.camera.sensor.dark_current_e_s = 0.0;
        profile.camera.sensor.prnu_percent = 0.0;
        profile.camera.sensor.dsnu_e = 0.0;
        profile.camera.sensor.blooming_percent = 0.0;
        profile.camera.sensor.response = Default::default();
        let reference = Reference::new(&profile, &scene).unwrap();
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let pattern_image = PatternImage::Uniform(level / 2);
        let found = renderer.expected_dn(&shot(Some(pattern_image.clone())));
        let width = profile.camera.width_px as usize;
        let (mut worst, mut range) = (0.0f64, [f64::INFINITY, 0.0f64]);
        for k in 0..60 {
            let (x, y) = (width / 2 - 150 + 5 * k, 200 + 2 * k);
            let px = DVec2::new(x as f64, y as f64);
            let exact = reference.signal_dn(px, &pattern_image, 8e-3, 4000);
            let error = (f64::from(found[y * width + x]) - exact).abs();
            worst = worst.max(error);
            range = [range[0].min(exact), range[1].max(exact)];
        }
        println!("{pattern}: {worst} DN of {range:?}");
        assert!(range[1] > 2.5 * range[0], "{range:?}");
        assert!(worst < 6e-3 * range[1], "{worst} of {range:?}");
    }
}

#[test]
fn samples_of_a_pixel_see_the_same_ink_and_the_back_is_blank() {
    let profile = Profile::load("pmp-bench").unwrap();
    let scene = before(
        DOTS,
        "position_mm = [10, -5, 1000]\nrotation_deg = [20, -35, 15]",
    );
    let frame = |scene: &Scene, samples: u32| {
        let options = Options {
            samples,
            ..Options::default()
        };
        let mut renderer = Renderer::with_options(&profile, scene, 1, options).unwrap();
        renderer.expected_dn(&shot(None))
    };
    let (one, sixteen) = (frame(&scene, 1), frame(&scene, 16));
    // Only pixels at least 6 mm inside the sheet are compared, which leaves out its edge.
    let inside = |i: usize| {
        let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
        let at = meets(&profile, &scene, px).abs();
        at.cmplt(board(&scene).sheet_mm() / 2.0 - 6.0).all()
    };
    let apart = (0..one.len())
        .filter(|&i| inside(i))
        .map(|i| (one[i] - sixteen[i]).abs())
        .fold(0.0, f32::max);
    assert!(apart < 0.02, "{apart} DN");
    let behind = before(
        DOTS,
        "position_mm = [0, 0, 1000]\nrotation_deg = [0, 180, 0]",
    );
    let levels = frame(&behind, 1);
    let white = levels.iter().copied().fold(0.0, f32::max);
    let middle = levels[244 * 1138 + 469..244 * 1138 + 669].iter();
    assert!(middle.clone().all(|v| *v == white), "the back has no ink");
}

#[test]
fn board_pattern_follows_the_motion_of_the_board() {
    let profile = Profile::load("pmp-bench").unwrap();
    let there = "position_mm = [30, -20, 980]\nrotation_deg = [0, 25, 0]";
    let still = before(CHESS, there);
    let moving = before(
        CHESS,
        "position_mm = [0, 0, 1000]\nmotion = { keyframes = [ { time_s = 0 }, { time_s = 1, \
         position_mm = [30, -20, -20], rotation_deg = [0, 25, 0] } ] }",
    );
    let mut at_end = shot(None);
    at_end.start_ns = 2_000_000_000;
    let [a, b] = [still, moving].map(|scene| {
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        renderer.expected_dn(&at_end)
    });
    let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
    let apart = apart.fold(0.0, f32::max);
    assert!(apart < 1e-3, "{apart}");
}

#[test]
fn impossible_boards_are_refused_with_their_line() {
    let refused = |shape: &str, more: &str, words: &str| {
        let text = format!(
            "name = \"s\"\ndescription = \"\"\n[[object]]\nalbedo = 0.5\nshape = {{ {shape} }}\n{more}"
        );
        let error = Scene::parse(&text, "s").unwrap_err().to_string();
        assert!(error.starts_with("s:") && error.contains(words), "{error}");
    };
    let of = |board: &str| format!("kind = \"board\", board = {{ {board} }}");
    refused(
        &of(&DOTS.replace("25", "6")),
        "",
        "object[0].shape.board.columns: 6; expected 7 to 199",
    );
    refused(
        &of(&DOTS.replace("10.0", "24.0")),
        "",
        "shape.board.dot_mm: 24",
    );
    refused(
        &of(&DOTS.replace("20.0", "10.0")),
        "",
        "shape.board.marker_mm: 10",
    );
    refused(
        &of(&CHESS.replace("50.0", "nan")),
        "",
        "shape.board.pitch_mm: NaN",
    );
    refused(
        &of(&CHESS.replace("9", "900")),
        "",
        "shape.board.columns: 900",
    );
    refused(&of(&format!("{CHESS}, dot_mm = 3.0")), "", "dot_mm");
    refused("kind = \"board\"", "", "board");
    refused(
        &format!("{}, ink = 1.5", of(CHESS)),
        "",
        "shape.ink: 1.5; expected 0 to 1",
    );
    refused(
        &of(CHESS),
        "texture = \"a.png\"\ntexture_size_mm = [1, 1]\n",
        "a texture on a board",
    );
}

#[test]
fn the_middle_of_the_view_is_the_middle_of_the_board() {
    // In the board's frame, x points right along columns, y down along rows, z away from the camera.
    let scene = Scene::load("board").unwrap();
    let object = &scene.object[0];
    let pose = scene.rig_from_object(object);
    assert_eq!(board(&scene), Board::DOTS.scaled(4.0));
    let board = board(&scene);
    let view = Profile::load("pmp-bench").unwrap().camera.view();
    let px = |index: [u32; 2]| {
        view.project(pose.point(board.point(index).extend(0.0)))
            .unwrap()
    };
    let middle = px([12, 9]);
    assert!(px([24, 9]).x > middle.x + 150.0 && px([12, 18]).y > middle.y + 100.0);
    assert!(pose.direction(DVec3::Z).z > 0.9);
}

#[test]
fn a_printed_board_is_not_overwritten_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_phasmid"));
        let output = command.arg("board").args(line.split_whitespace());
        let output = output.current_dir(folder.path()).output().unwrap();
        let said = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        (output.status.code(), said.concat())
    };
    let (status, said) = run("--kind dots --out dots.svg");
    assert_eq!(
        (status, said.starts_with("dots.svg: 156 x 130 mm;")),
        (Some(0), true),
        "{said}"
    );
    let file = folder.path().join("dots.svg");
    let dots = std::fs::read_to_string(&file).unwrap();
    assert_eq!(dots.matches("<circle").count(), 25 * 19);
    assert_eq!(dots.matches("r=\"2.5\"").count(), 5);
    let (status, said) = run("--kind chess --out dots.svg");
    assert_eq!(status, Some(2));
    assert!(
        said.contains("dots.svg: an existing file; expected"),
        "{said}"
    );
    assert_eq!(std::fs::read_to_string(&file).unwrap(), dots);
    assert_eq!(run("--kind chess --out dots.svg --force").0, Some(0));
    let chess = std::fs::read_to_string(&file).unwrap();
    // One rectangle for each dark square (half of the 70 squares), and one for the page.
    assert_eq!(chess.matches("<rect").count(), 35 + 1);
    let (status, said) = run("--kind dots --dot-mm 7 --out other.svg");
    assert_eq!(status, Some(2));
    assert!(said.contains("--dot-mm: 7; expected"), "{said}");
    let (status, said) = run("--kind dots --out missing/other.svg");
    assert!(
        status != Some(0) && said.contains("missing/other.svg"),
        "{said}"
    );
}
