//! Transforms against their inverses, and interpolation of polynomials that it reproduces exactly.

use super::*;
use glam::{DMat3, DQuat, DVec3};

fn oblique() -> Grid {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.5, 1.1);
    Grid {
        size: [7, 5, 4],
        spacing_mm: DVec3::new(0.9, 1.3, 3.0),
        origin_mm: DVec3::new(-120.0, 33.0, 810.0),
        // Left-handed grids are allowed too.
        direction: DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)),
    }
}

/// A function that trilinear interpolation along the grid's axes reproduces exactly.
fn trilinear(i: DVec3) -> f64 {
    3.0 - i.x + 2.0 * i.y + 0.5 * i.z - 0.25 * i.x * i.y + i.y * i.z - 0.125 * i.x * i.y * i.z
}

#[test]
fn an_index_is_the_inverse_of_a_point() {
    let grid = oblique();
    assert_eq!(grid.point(DVec3::ZERO), grid.origin_mm);
    for index in [
        DVec3::ZERO,
        DVec3::new(6.0, 4.0, 3.0),
        DVec3::new(-9.5, 2.25, 80.0),
    ] {
        assert!((grid.index(grid.point(index)) - index).length() < 1e-12);
    }
    // A step along j is one spacing along the second column.
    let step = grid.point(DVec3::Y) - grid.point(DVec3::ZERO);
    assert!((step - 1.3 * grid.direction.y_axis).length() < 1e-12);
}

#[test]
fn interpolation_takes_trilinear_functions_exactly() {
    let grid = oblique();
    let volume = Volume::of(grid, |p| trilinear(grid.index(p)), "v").unwrap();
    let field = Field::of(
        grid,
        |p| trilinear(grid.index(p)) * DVec3::new(1.0, -2.0, 0.5),
        "f",
    )
    .unwrap();
    for index in [
        DVec3::ZERO,
        DVec3::new(6.0, 4.0, 3.0),
        DVec3::new(0.1, 3.9, 2.5),
        DVec3::new(5.5, 0.25, 1.75),
    ] {
        let exact = trilinear(index);
        let p = grid.point(index);
        assert!((volume.at(p).unwrap() - exact).abs() < 2e-5, "{index}");
        let u = field.at(p).unwrap();
        assert!((u - exact * DVec3::new(1.0, -2.0, 0.5)).length() < 5e-5);
    }
}

#[test]
fn value_beyond_the_voxels_is_none() {
    let grid = oblique();
    let volume = Volume::of(grid, |p| grid.index(p).x, "v").unwrap();
    let at = |i: f64| volume.at(grid.point(DVec3::new(i, 2.0, 1.0)));
    // Up to half a voxel beyond the last centre the value is the value at this centre; farther out it is
    // `None`.
    assert!((at(-0.49).unwrap()).abs() < 1e-5);
    assert!((at(6.49).unwrap() - 6.0).abs() < 1e-5);
    assert_eq!(at(-0.53), None);
    assert_eq!(at(6.53), None);
    assert_eq!(volume.at(DVec3::NAN), None);
    let one = Grid::upright([1, 1, 1], DVec3::ONE, DVec3::ZERO);
    let one = Volume::new(one, Voxels::I16(vec![-700]), "v").unwrap();
    assert_eq!(one.at(DVec3::splat(0.4)), Some(-700.0));
    assert_eq!(one.nearest(DVec3::NAN), -700.0);
}

#[test]
fn impossible_grids_and_fields_are_refused_by_value() {
    let good = oblique();
    let words = |grid: Grid| grid.checked("ct.mha").unwrap_err().to_string();
    let mut grid = good;
    grid.size[1] = 0;
    assert!(words(grid).contains("ct.mha: 7 x 0 x 4 voxels"));
    grid.size = [1 << 14, 1 << 14, 2];
    assert!(words(grid).contains("268435456 voxels in all"));
    grid.size = [usize::MAX; 3];
    assert!(words(grid).contains("along each axis"));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9] {
        grid = good;
        grid.spacing_mm.z = bad;
        assert!(words(grid).contains("a spacing of (0.9, 1.3, "), "{bad}");
    }
    grid = good;
    grid.origin_mm.x = f64::NAN;
    assert!(words(grid).contains("an origin at (NaN, "));
    grid = good;
    grid.direction.x_axis *= 1.01;
    assert!(words(grid).contains("orthonormal"));
    grid.direction = DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z);
    assert!(words(grid).contains("directions (1, 0, 0), (1, 0, 0), (0, 0, 1)"));

    let short = Volume::new(good, Voxels::I16(vec![0; 139]), "v").unwrap_err();
    assert_eq!(
        short.to_string(),
        "v: 139 numbers; expected 140, one per voxel of its grid"
    );
    let mut numbers = vec![0.0; 140];
    numbers[7] = f32::NAN;
    let bad = Volume::new(good, Voxels::F32(numbers), "v").unwrap_err();
    assert_eq!(bad.to_string(), "v: voxel 7: NaN; expected finite numbers");
    let mut vectors = vec![[0.0; 3]; 140];
    vectors[3] = [0.0, f32::INFINITY, 0.0];
    let bad = Field::new(good, vectors, "f").unwrap_err().to_string();
    assert!(bad.contains("f: voxel 3: a displacement of (0, inf, 0)"));
}

#[test]
fn grids_differ_in_words() {
    let good = oblique();
    let mut other = good;
    // The rounding to six digits in a file is not a difference.
    other.origin_mm += 1e-4;
    other.spacing_mm *= 1.0 + 1e-6;
    assert_eq!(good.difference(&other), None);
    other = good;
    other.size[2] = 5;
    let (here, there) = good.difference(&other).unwrap();
    assert_eq!(
        (here.as_str(), there.as_str()),
        ("7 x 5 x 4 voxels", "7 x 5 x 5 voxels")
    );
    other = good;
    other.spacing_mm.z = 2.5;
    assert!(good.difference(&other).unwrap().1.contains("spacing"));
    other = good;
    other.origin_mm.x += 0.5;
    assert!(good.difference(&other).unwrap().1.contains("origin"));
    other = good;
    other.direction = DMat3::IDENTITY;
    assert!(good.difference(&other).unwrap().1.contains("directions"));
}

#[test]
fn a_shift_moves_the_points_and_not_their_displacements() {
    let grid = oblique();
    let shift = DVec3::new(10.0, -4.0, 0.5);
    let field = Field::of(grid, |p| 0.01 * p, "f").unwrap();
    let p = grid.point(DVec3::new(2.3, 1.1, 0.4));
    let u = field.at(p).unwrap();
    let longest = field.longest_mm();
    let moved = field.shifted(shift);
    assert!((moved.at(p + shift).unwrap() - u).length() < 1e-9);
    assert_eq!(moved.longest_mm(), longest);
}
