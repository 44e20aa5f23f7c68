//! Several bodies and cavities, noise, and volumes without a surface.

use super::*;

#[test]
fn a_body_alone_remains_and_its_cavities_if_wanted() {
    let grid = Grid::upright([60, 50, 40], DVec3::ONE, DVec3::ZERO);
    let ball = |p: DVec3, x: f64, y: f64, z: f64, r: f64| r - (p - DVec3::new(x, y, z)).length();
    // A body with a bubble and a lung that a trachea connects to the first slice; a couch; and an
    // isolated marker in the lung.
    let value = |p: DVec3| {
        let body = ball(p, 25.0, 25.0, 12.0, 20.0);
        let lung = ball(p, 25.0, 25.0, 10.0, 7.0);
        let windpipe = (3.0 - (p - DVec3::new(25.0, 25.0, p.z)).length()).min(10.0 - p.z);
        let bubble = ball(p, 38.0, 25.0, 12.0, 3.0);
        let marker = ball(p, 25.0, 25.0, 12.0, 1.5);
        let couch = 1.5 - (p.x - 54.0).abs();
        body.min(-lung)
            .min(-windpipe)
            .min(-bubble)
            .max(marker)
            .max(couch)
    };
    let volume = Volume::of(grid, value, "ct").unwrap();
    let parts = |parts| closed_manifold(&isosurface(&volume, 0.0, parts, "ct").unwrap());
    let [all, largest, filled] = [Parts::All, Parts::Largest, Parts::LargestFilled].map(parts);
    // Body with lung (a dent, because of the trachea), bubble, marker, couch.
    assert_eq!(all.components, 4);
    assert_eq!(largest.components, 2);
    assert_eq!((filled.components, filled.euler), (1, 2));
    // The cap of the first slice is at the outer faces, half a millimetre below.
    let cut: f64 = 20.0 - 12.5;
    let ball = 4.0 / 3.0 * PI * 8000.0 - PI * cut * cut * (60.0 - cut) / 3.0;
    assert!(
        (filled.volume / ball - 1.0).abs() < 5e-3,
        "{}",
        filled.volume / ball
    );
    let bubble = 4.0 / 3.0 * PI * 27.0;
    assert!(filled.volume - largest.volume > bubble + 4.0 / 3.0 * PI * 343.0);
}

#[test]
fn noise_has_a_closed_manifold_surface_too() {
    let mut state = 9_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 40) as i16
    };
    for (ni, nj, nk) in [
        (1, 1, 1),
        (2, 3, 4),
        (63, 5, 4),
        (64, 4, 5),
        (130, 7, 6),
        (9, 20, 31),
    ] {
        for level in [-6.0, 0.0, 13.0, 27.0] {
            let grid = Grid::upright([ni, nj, nk], DVec3::new(1.0, 0.7, 3.0), DVec3::ZERO);
            // Few distinct values, so that many voxels are exactly at the level.
            let voxels: Vec<i16> = (0..ni * nj * nk).map(|_| next() % 33).collect();
            let volume = Volume::new(grid, Voxels::I16(voxels), "noise").unwrap();
            let all = match isosurface(&volume, level, Parts::All, "noise") {
                Ok(mesh) => mesh,
                Err(e) => {
                    assert!(e.to_string().contains("no voxel of"), "{e}");
                    continue;
                }
            };
            closed_manifold(&all);
            for v in &all.vertices {
                let index = grid.index(*v);
                // Within the box of the centres, all vertices are on the level, except vertices that
                // were moved to keep the minimum distance from centres.
                if index.cmpge(DVec3::ZERO).all() && index.cmple(grid.last()).all() {
                    assert!((volume.nearest(index) - level).abs() < 0.1, "{index}");
                }
            }
            let facts = |parts| closed_manifold(&isosurface(&volume, level, parts, "n").unwrap());
            let largest = facts(Parts::Largest);
            let filled = facts(Parts::LargestFilled);
            assert_eq!(filled.components, 1);
            assert!(filled.volume >= largest.volume && largest.volume > 0.0);
            assert!(filled.area > 0.0);
        }
    }
}

#[test]
fn the_same_on_any_number_of_threads() {
    let grid = grid(20.0, DVec3::new(1.0, 1.1, 1.3), DVec3::ZERO, false);
    let volume = Volume::of(grid, |p| 15.0 - p.length(), "ball").unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let mesh = || isosurface(&volume, 0.0, Parts::LargestFilled, "ball").unwrap();
        pool.unwrap().install(mesh)
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn refuses_level_above_all_voxels() {
    let grid = Grid::upright([2, 2, 2], DVec3::ONE, DVec3::ZERO);
    let air = Volume::new(grid, Voxels::I16(vec![-1000; 8]), "ct").unwrap();
    let words = |level| {
        isosurface(&air, level, Parts::All, "ct.mha")
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        words(-500.0),
        "ct.mha: no voxel of -500 or more; expected a level up to -1000"
    );
    assert!(words(f64::NAN).contains("a level of NaN"));
    // A body that fills the volume ends at its outer faces.
    let block = closed_manifold(&isosurface(&air, -1000.0, Parts::All, "ct").unwrap());
    assert_eq!((block.components, block.euler), (1, 2));
    assert!((4.0..8.0).contains(&block.volume), "{}", block.volume);
}
