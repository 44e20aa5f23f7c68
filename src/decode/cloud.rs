//! Converts depth maps to points, with normals from neighbouring pixels.

use super::decoder::Decoder;
use super::maps::Decoded;
use glam::Vec3;
use phasmid_geometry::Cloud;
use rayon::prelude::*;

/// Neighbours whose depths differ by more than this fraction of the depth (and by 10 sigma) are on
/// another surface.
const SAME_SURFACE: f32 = 0.02;

/// Position, normal, intensity and standard deviation of a point.
type Oriented = ([f32; 3], [f32; 3], [f32; 2]);

impl Decoder {
    /// Writes the valid points, in the rig's frame in mm, row by row into a reusable vector. Empty
    /// without a rig.
    pub fn points_into(&self, decoded: &Decoded, points: &mut Vec<[f32; 3]>) {
        points.clear();
        let Some(triangulator) = self.triangulator() else {
            return;
        };
        let width = decoded.width;
        let counts: Vec<usize> = decoded
            .depth
            .par_chunks(width)
            .with_min_len(32)
            .map(|row| row.iter().filter(|z| !z.is_nan()).count())
            .collect();
        points.resize(counts.iter().sum(), [0.0; 3]);
        let mut rest = &mut points[..];
        let mut rows = Vec::with_capacity(counts.len());
        for (v, &count) in counts.iter().enumerate() {
            let (row, tail) = rest.split_at_mut(count);
            rest = tail;
            rows.push((v, row));
        }
        rows.into_par_iter().with_min_len(8).for_each(|(v, row)| {
            let depth = &decoded.depth[v * width..(v + 1) * width];
            triangulator.points_row(v, depth, row);
        });
    }

    /// Returns the valid points with intensities, standard deviations and normals towards the camera.
    /// Empty without a rig.
    pub fn cloud(&self, decoded: &Decoded) -> Cloud {
        let Some(triangulator) = self.triangulator() else {
            return Cloud::default();
        };
        let (width, height) = (decoded.width, decoded.height);
        let eye = triangulator.rig().camera.center().as_vec3();
        let same = |i: usize, j: usize| {
            let (a, b) = (decoded.depth[i], decoded.depth[j]);
            let noise = 10.0 * (decoded.depth_sigma[i] + decoded.depth_sigma[j]);
            ((a - b).abs() <= (SAME_SURFACE * a).max(noise)).then_some(j)
        };
        let at = |i: usize| Vec3::from(triangulator.point(i % width, i / width, decoded.depth[i]));
        let rows: Vec<Vec<Oriented>> = (0..height)
            .into_par_iter()
            .map(|v| {
                let mut row = Vec::new();
                for u in 0..width {
                    let i = v * width + u;
                    if decoded.depth[i].is_nan() {
                        continue;
                    }
                    let left = (u > 0).then(|| same(i, i - 1)).flatten().unwrap_or(i);
                    let right = (u + 1 < width)
                        .then(|| same(i, i + 1))
                        .flatten()
                        .unwrap_or(i);
                    let up = (v > 0).then(|| same(i, i - width)).flatten().unwrap_or(i);
                    let down = (v + 1 < height)
                        .then(|| same(i, i + width))
                        .flatten()
                        .unwrap_or(i);
                    let p = at(i);
                    // The cross product of downwards and rightwards points at a camera that looks
                    // along z.
                    let normal = (at(down) - at(up)).cross(at(right) - at(left));
                    let to_eye = (eye - p).normalize_or(Vec3::NEG_Z);
                    let normal = normal.normalize_or(to_eye);
                    let normal = if normal.dot(to_eye) < 0.0 {
                        -normal
                    } else {
                        normal
                    };
                    let along_ray = (p - eye).length() / decoded.depth[i];
                    let sigma = decoded.depth_sigma[i] * along_ray;
                    row.push((p.into(), normal.into(), [decoded.intensity[i], sigma]));
                }
                row
            })
            .collect();
        let all = || rows.iter().flatten();
        Cloud {
            points: all().map(|p| p.0).collect(),
            normals: Some(all().map(|p| p.1).collect()),
            intensity: Some(all().map(|p| p.2[0]).collect()),
            sigma_mm: Some(all().map(|p| p.2[1]).collect()),
        }
    }
}
