//! Imports bodies of known shape.

mod refused;

use super::*;
use crate::isosurface::{Parts, SKIN_HU, isosurface};
use crate::metaimage::{write_field, write_volume};
use crate::planning::Planning;
use crate::volume::{Field, Volume};

fn silent(_: &str) {}

/// Centre of the test body, in the scanner's LPS.
const CENTRE: DVec3 = DVec3::new(12.0, -140.0, -812.0);
const BODY_MM: f64 = 50.0;
const TUMOUR_MM: f64 = 12.0;

fn grid(spacing_mm: f64, half_mm: f64) -> Grid {
    let steps = (2.0 * half_mm / spacing_mm).round();
    Grid::upright(
        [steps as usize + 1; 3],
        DVec3::splat(spacing_mm),
        CENTRE - 0.5 * steps * spacing_mm,
    )
}

/// Hounsfield units of a ball of water in air, with a transition 4 mm wide.
fn body(p: DVec3) -> f64 {
    let inside = BODY_MM - (p - CENTRE).length();
    -1000.0 + 1000.0 * (0.5 + 0.25 * inside).clamp(0.0, 1.0)
}

fn moved(p: DVec3, percent: f64) -> DVec3 {
    let depth = 1.0 + (percent * 0.02 * std::f64::consts::PI).cos();
    depth * DVec3::new(0.0, -2.0, 4.0 + 0.05 * (p - CENTRE).y)
}

fn ball(radius: f64) -> Mesh {
    let value = |p: DVec3| radius - (p - CENTRE).length();
    let volume = Volume::of(grid(2.0, 20.0), value, "ball").unwrap();
    isosurface(&volume, 0.0, Parts::Largest, "ball").unwrap()
}

/// Creates a folder with `ct.mha`, `tumour.ply` and fields of three phases, and returns its import.
fn small() -> (tempfile::TempDir, Import) {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let ct = Volume::of(grid(4.0, 64.0), body, "ct").unwrap();
    write_volume(&path("ct.mha"), &ct, Packing::Plain).unwrap();
    ply::write_mesh(&path("tumour.ply"), &ball(TUMOUR_MM)).unwrap();
    let mut phases = Vec::new();
    for percent in [0.0, 30.0, 50.0] {
        let field = Field::of(grid(8.0, 64.0), |p| moved(p, percent), "dvf").unwrap();
        let file = path(&format!("{percent}.mhd"));
        write_field(&file, &field, Packing::Zlib).unwrap();
        phases.push((percent, file));
    }
    let import = Import {
        name: "p01".to_owned(),
        ct: path("ct.mha"),
        skin_hu: SKIN_HU,
        tumour: path("tumour.ply"),
        isocentre_mm: None,
        reference_percent: 50.0,
        phases,
        spacing_mm: None,
        with_ct: false,
        force: false,
    };
    (dir, import)
}

#[test]
fn imported_body_matches_its_closed_form() {
    let (dir, mut import) = small();
    let out = dir.path().join("a/planning");
    let steps = std::cell::RefCell::new(Vec::new());
    let step = |what: &str| steps.borrow_mut().push(what.to_owned());
    let made = import.write(&out, &step).unwrap();
    assert_eq!(
        steps.into_inner(),
        [
            "CT",
            "tumour",
            "skin",
            "phase 0 %",
            "phase 30 %",
            "phase 50 %"
        ]
    );
    assert!(
        (made.tumour_mm - CENTRE).length() < 1e-3,
        "{:?}",
        made.tumour_mm
    );
    let planning = Planning::load(&out).unwrap();
    for v in &planning.skin.vertices {
        // The tolerance is for 4 mm voxels with partial volumes.
        assert!((v.length() - BODY_MM).abs() < 0.4, "{v}");
    }
    assert!((made.tumour_motion_mm - moved(CENTRE, 0.0).length()).abs() < 1e-3);

    // The same tumour as a mask of fine voxels, with a separate part.
    let apart = CENTRE + DVec3::new(0.0, 0.0, 20.0);
    let full = |p: DVec3| {
        let inside = (TUMOUR_MM - (p - CENTRE).length()).max(3.0 - (p - apart).length());
        (0.5 + inside).clamp(0.0, 1.0)
    };
    let mask = Volume::of(grid(1.0, 28.0), full, "mask").unwrap();
    import.tumour = dir.path().join("mask.mha");
    write_volume(&import.tumour, &mask, Packing::Zlib).unwrap();
    let made = import.write(&dir.path().join("masked"), &silent).unwrap();
    let third = 4.0 / 3.0 * std::f64::consts::PI;
    let exact = third * (TUMOUR_MM.powi(3) + 27.0);
    assert!(
        (made.tumour_mm3 / exact - 1.0).abs() < 0.01,
        "{}",
        made.tumour_mm3
    );
}

#[test]
fn fields_on_a_coarser_grid_say_the_same() {
    let (dir, mut import) = small();
    import.spacing_mm = Some(15.0);
    import.phases.pop();
    let out = dir.path().join("planning");
    let made = import.write(&out, &silent).unwrap();
    assert_eq!(made.file.spacing_mm.0, DVec3::splat(15.0));
    let planning = Planning::load(&out).unwrap();
    for (percent, field) in &planning.phases {
        let grid = field.grid();
        // 128 mm are 8.5 steps of 15 mm.
        assert_eq!(grid.size, [10; 3]);
        assert!(grid.point(grid.last() / 2.0).length() < 1e-3);
        for v in &planning.skin.vertices {
            // A shear is linear, so interpolation is exact.
            let exact = match *percent {
                50.0 => DVec3::ZERO,
                percent => moved(*v + made.file.isocentre_mm, percent),
            };
            assert!(
                (field.at(*v).unwrap() - exact).length() < 1e-4,
                "{percent}: {v}"
            );
        }
    }
}

#[test]
fn finds_points_outside_a_closed_surface() {
    let surface = ball(13.0);
    let near = surface.vertices[0];
    // Include points of the grid on which the surface was made: their rays run along edges of the grid.
    let mut points = vec![near + 0.1 * (near - CENTRE).normalize()];
    let lattice = grid(2.0, 20.0);
    for n in 0..lattice.voxels() {
        let index = [n % 21, n / 21 % 21, n / 441].map(|x| x as f64);
        points.push(lattice.point(DVec3::from_array(index)));
    }
    let outside = tumour::outside(&points, &surface);
    let wanted: Vec<usize> = (0..points.len())
        .filter(|&n| (points[n] - CENTRE).length() > 13.0)
        .collect();
    assert_eq!(outside, wanted);
    assert_eq!(outside[0], 0);
}
