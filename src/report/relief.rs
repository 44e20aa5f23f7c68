//! Shading of depth maps, which shows the shape of a surface.

/// Computes the brightness of each pixel of a depth map under a lamp at the upper left, 0 to 1; NaN for
/// pixels without depth, or without a neighbour along x or y. The surface is Lambertian, with 12 %
/// ambient light.
///
/// The normal is (fx dz/du, fy dz/dv, -z): depth as a height over the image, with the width and
/// height of a pixel at its depth. `focal_px` holds fx and fy. Derivatives are differences between
/// neighbours.
pub fn shades(width: u32, height: u32, depth_mm: &[f32], focal_px: [f32; 2]) -> Vec<f32> {
    const LAMP: [f32; 3] = [-0.45, -0.6, -0.66];
    let z = |x: u32, y: u32| value(depth_mm, width, x, y);
    // Central difference if both neighbours are known, one-sided difference if only one is known.
    let slope = |before: Option<f32>, here: f32, after: Option<f32>| {
        let known = |v: Option<f32>| v.filter(|v| v.is_finite());
        match (known(before), known(after)) {
            (Some(a), Some(b)) => (b - a) / 2.0,
            (Some(a), None) => here - a,
            (None, Some(b)) => b - here,
            (None, None) => f32::NAN,
        }
    };
    let mut out = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let here = z(x, y);
            let across = slope(
                x.checked_sub(1).map(|x| z(x, y)),
                here,
                (x + 1 < width).then(|| z(x + 1, y)),
            );
            let down = slope(
                y.checked_sub(1).map(|y| z(x, y)),
                here,
                (y + 1 < height).then(|| z(x, y + 1)),
            );
            let normal = [
                across,
                down * (focal_px[1] / focal_px[0]),
                -here / focal_px[0],
            ];
            let length = normal.iter().map(|n| n * n).sum::<f32>().sqrt();
            let lit = normal.iter().zip(LAMP).map(|(n, l)| n * l).sum::<f32>() / length;
            out.push(if lit.is_nan() {
                lit
            } else {
                0.12 + 0.88 * lit.max(0.0)
            });
        }
    }
    out
}

fn value(values: &[f32], width: u32, x: u32, y: u32) -> f32 {
    let at = y as usize * width as usize + x as usize;
    values.get(at).copied().unwrap_or(f32::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_evenly_lit_and_slopes_towards_the_lamp_are_brighter() {
        let flat = vec![1000.0; 20 * 20];
        let shade = shades(20, 20, &flat, [500.0; 2]);
        assert!(shade.iter().all(|s| (s - shade[0]).abs() < 1e-6));
        // The surface rises towards the camera to the right, so it faces the lamp at the left.
        let tilt = |sign: f32| -> Vec<f32> {
            let z: Vec<f32> = (0..400).map(|i| 1000.0 - sign * (i % 20) as f32).collect();
            shades(20, 20, &z, [500.0; 2])
        };
        assert!(tilt(1.0)[210] > shade[0] && tilt(-1.0)[210] < shade[0]);
        let hole = [1000.0, f32::NAN, 1000.0, 1000.0];
        assert!(shades(2, 2, &hole, [500.0; 2])[1].is_nan());
    }
}
