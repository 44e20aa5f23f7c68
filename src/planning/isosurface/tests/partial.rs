//! Partial volumes: the resulting error of linear interpolation.

use super::*;

/// Returns the fraction of a voxel that lies inside a plane, if its centre is x voxels inside: the
/// fraction of [-1/2, 1/2] below x.
fn full(x: f64) -> f64 {
    (x + 0.5).clamp(0.0, 1.0)
}

#[test]
fn partial_volumes_put_a_plane_where_theory_says() {
    // A voxel that a plane crosses has a partial volume of air (-1000) and tissue (40). Between a voxel
    // of fill f = 1/2 + x and an empty voxel, the level c is found at 1 - c / f instead of x: the error
    // is at most 3/2 - 2 sqrt c, 0.0858 voxels at c = 1/2, and the same with 1 - c from the other side.
    // A scanner's blur reduces it.
    for (level, part) in [(-480.0, 0.5), (SKIN_HU, 0.5 / 1.04), (-400.0, 0.6 / 1.04)] {
        let worst = (0..400)
            .map(|step| {
                let plane = 4.0 + f64::from(step) / 400.0;
                let grid = Grid::upright([3, 3, 9], DVec3::new(1.0, 1.0, 2.5), DVec3::ZERO);
                let hu = |i: usize| -1000.0 + 1040.0 * full(plane - (i / 9) as f64);
                let voxels = (0..81).map(|i| hu(i).round() as i16).collect();
                let volume = Volume::new(grid, Voxels::I16(voxels), "plane").unwrap();
                let mesh = isosurface(&volume, level, Parts::All, "plane").unwrap();
                closed_manifold(&mesh);
                // The lowest cap is at the volume's face; the highest vertices are on the plane.
                let (low, high) = mesh.bounds().unwrap();
                assert!((low.z + 1.25).abs() < 1e-12);
                (high.z / 2.5 - plane).abs()
            })
            .fold(0.0, f64::max);
        let c: f64 = f64::max(part, 1.0 - part);
        let theory = 1.5 - 2.0 * (1.0 - c).sqrt();
        // Rounding to integers causes errors of half a unit in 1040, which the division may double.
        assert!(
            (worst - theory).abs() < 2e-3,
            "{level}: {worst}, not {theory}"
        );
    }
}

/// Returns the fraction of a voxel that a ball fills, from the lengths inside the ball of 16 x 16 lines
/// through the voxel.
fn filling(grid: &Grid, centre: DVec3, radius: f64, p: DVec3) -> f64 {
    let out = p - centre;
    if (out.length() - radius).abs() > 2.0 {
        return f64::from(u8::from(out.length() < radius));
    }
    // Lines along the axis that crosses the ball most steeply.
    let steep = (grid.direction.transpose() * out).abs() * grid.spacing_mm;
    let along = (0..3).fold(0, |a, b| if steep[b] > steep[a] { b } else { a });
    let (u, v) = ((along + 1) % 3, (along + 2) % 3);
    let half = grid.spacing_mm[along] / 2.0;
    let way = grid.direction.col(along);
    let mut sum = 0.0;
    for n in 0..256 {
        let mut part = DVec3::ZERO;
        part[u] = (f64::from(n % 16) + 0.5) / 16.0 - 0.5;
        part[v] = (f64::from(n / 16) + 0.5) / 16.0 - 0.5;
        let from = out + grid.direction * (grid.spacing_mm * part);
        let middle = -from.dot(way);
        let square = radius * radius - (from + middle * way).length_squared();
        if square > 0.0 {
            let reach = square.sqrt();
            let inside = (middle + reach).min(half) - (middle - reach).max(-half);
            sum += inside.max(0.0) / (2.0 * half);
        }
    }
    sum / 256.0
}

#[test]
fn partial_volumes_put_a_sphere_within_a_tenth_of_a_voxel() {
    let (radius, centre) = (35.0, DVec3::new(1.0, 2.0, 3.0));
    let grid = grid(38.0, DVec3::new(1.0, 1.0, 2.5), centre, false);
    let hu = |p| (-1000.0 + 1040.0 * filling(&grid, centre, radius, p)).round();
    let volume = Volume::of(grid, hu, "ct").unwrap();
    let mesh = isosurface(&volume, -480.0, Parts::LargestFilled, "ct").unwrap();
    closed_manifold(&mesh);
    let (mut worst, mut square) = (0.0_f64, 0.0);
    for v in &mesh.vertices {
        // In voxels along the axis that crosses the surface most steeply.
        let out = (*v - centre).normalize();
        let steps = (grid.direction.transpose() * out).abs() * grid.spacing_mm;
        let voxel = steps.max_element();
        let off = ((*v - centre).length() - radius) / voxel;
        worst = worst.max(off.abs());
        square += off * off;
    }
    let rms = (square / mesh.vertices.len() as f64).sqrt();
    assert!(worst < 0.1, "{worst} voxels at worst, {rms} RMS");
    assert!(rms < 0.05, "{rms} RMS");
}
