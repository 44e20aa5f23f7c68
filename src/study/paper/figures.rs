//! Errors of a measured surface as the paper reports them (MAE, CMAE, HD, MDTA), and how tables read
//! and write them.

use glam::{DVec2, DVec3};
use phasmid_core::error::Result;
use phasmid_geometry::{Cloud, Mesh, MeshTree, Neighbours, Rig};
use phasmid_measure::{Directed, GROSS_MM, Stated, Surface, lit_and_seen};
use phasmid_render::truth::Truth;
use phasmid_report::lab::{Row, Rows};
use rayon::prelude::*;

/// Number of points, spread over the true surface, that are tried as samples.
const SAMPLES: usize = 60_000;
/// Maximum distance in mm at which a true point belongs to the object's surface: depths are f32.
const ON_MM: f64 = 0.05;

/// The surface to measure, as a camera sees it.
pub struct Target {
    tree: MeshTree,
    /// Points spread evenly over the lit and visible part of the surface, in the rig's frame.
    samples: Vec<DVec3>,
    /// Rays of the camera's pixels.
    rays: Vec<DVec3>,
    /// Pixels whose ray meets the object.
    pub on: Vec<usize>,
}

/// Number of kinds of pixels with gross errors, by the surface on the ray through their middle: at
/// grazing incidence or with fringes too fine to resolve; in shadow; with more than one facet in the
/// pixel; smooth.
pub const KINDS: usize = 4;

/// Errors in millimetres; an error is NaN if there are no pixels from which to compute it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Measured pixels of the object.
    pub points: usize,
    /// Among the pixels that see one lit facet at less than 80 degrees of incidence, the measured
    /// fraction.
    pub coverage: f64,
    /// Share of the points more than 1 mm off in depth.
    pub gross: f64,
    /// Fraction of the points off by more than five stated standard deviations; NaN if none are stated.
    pub beyond: f64,
    /// Number of points more than 1 mm off, for each of [`KINDS`].
    pub gross_kinds: [usize; KINDS],
    /// Root mean square depth error of the points without a gross error.
    pub inlier_rmse_mm: f64,
    /// Mean absolute depth error of all points, including creases.
    pub mae_mm: f64,
    /// Mean absolute depth error along the camera's middle row.
    pub cmae_mm: f64,
    /// Hausdorff distance and mean distance to agreement, between points and surface in both directions.
    pub surface_mm: [f64; 2],
    /// The larger of the 95th percentiles of the two directed distances.
    pub surface_p95_mm: f64,
    /// Largest and mean distance from the points of the true surface to the nearest measured point.
    pub points_mm: [f64; 2],
    /// The values that `points_mm` would have if the measured points had no errors.
    pub floor_mm: [f64; 2],
}

/// Distances between the measured and the true surface in mm.
struct Distances {
    /// Largest, mean and 95th percentile: between points and surface, in both directions.
    surface: [f64; 3],
    /// Largest and mean: from the true surface to the measured points.
    points: [f64; 2],
    /// Largest and mean: from the true surface to points without errors.
    floor: [f64; 2],
}

impl Distances {
    const NONE: Self = Self {
        surface: [f64::NAN; 3],
        points: [f64::NAN; 2],
        floor: [f64::NAN; 2],
    };
}

impl Figures {
    /// Columns that [`Self::row`] fills.
    pub const COLUMNS: [&'static str; 18] = [
        "points",
        "coverage",
        "gross",
        "beyond_5_sigma",
        "inlier_rmse_mm",
        "mae_mm",
        "cmae_mm",
        "hd_surface_mm",
        "mdta_surface_mm",
        "hd95_surface_mm",
        "hd_points_mm",
        "mdta_points_mm",
        "hd_floor_mm",
        "mdta_floor_mm",
        "gross_grazing",
        "gross_unlit",
        "gross_edge",
        "gross_smooth",
    ];

    /// Adds these figures to a row.
    pub fn row(&self, row: Row) -> Row {
        let [grazing, unlit, edge, smooth] = self.gross_kinds.map(|count| count as f64);
        let values = [
            self.points as f64,
            self.coverage,
            self.gross,
            self.beyond,
            self.inlier_rmse_mm,
            self.mae_mm,
            self.cmae_mm,
            self.surface_mm[0],
            self.surface_mm[1],
            self.surface_p95_mm,
            self.points_mm[0],
            self.points_mm[1],
            self.floor_mm[0],
            self.floor_mm[1],
            grazing,
            unlit,
            edge,
            smooth,
        ];
        let named = Self::COLUMNS.into_iter().zip(values);
        named.fold(row, |row, (name, value)| row.number(name, value))
    }
}

impl Target {
    /// Creates a target from a surface in the rig's frame and the rendered truth.
    pub fn new(mesh: &Mesh, rig: &Rig, truth: &Truth) -> Self {
        let tree = MeshTree::new(mesh);
        let width = truth.width as usize;
        let rays: Vec<DVec3> = (0..truth.depth_mm.len())
            .map(|i| {
                let px = DVec2::new((i % width) as f64, (i / width) as f64);
                rig.camera.ray(px)
            })
            .collect();
        let near = |i: usize| {
            let point = rays[i] * f64::from(truth.depth_mm[i]);
            tree.closest(point)
                .is_some_and(|foot| foot.distance_mm < ON_MM)
        };
        let on = (0..rays.len()).into_par_iter().filter(|&i| near(i));
        Self {
            on: on.collect(),
            samples: lit_and_seen(mesh, &tree, rig, SAMPLES),
            rays,
            tree,
        }
    }

    /// Returns the point of a pixel at a depth, in the rig's frame, in mm.
    pub fn point(&self, i: usize, depth_mm: f32) -> DVec3 {
        self.rays[i] * f64::from(depth_mm)
    }

    /// Computes the errors of measured depths in mm, row by row, NaN where missing; `sigma` are their
    /// standard deviations, if known.
    ///
    /// # Errors
    /// Returns the errors of [`Surface::new`].
    pub fn figures(&self, depth: &[f32], sigma: Option<&[f32]>, truth: &Truth) -> Result<Figures> {
        let measured: Vec<usize> = (self.on.iter().copied())
            .filter(|&i| depth[i].is_finite())
            .collect();
        let error = |i: &usize| f64::from(depth[*i] - truth.depth_mm[*i]).abs();
        let all = Directed::of(measured.iter().map(error).collect());
        let middle = truth.height as usize / 2;
        let in_middle = |i: &&usize| **i / truth.width as usize == middle;
        let section = Directed::of(measured.iter().filter(in_middle).map(error).collect());
        let distances = self.distances(depth, truth, &measured)?;
        let stated = sigma
            .map(|sigma| Stated::of(measured.iter().map(|i| (error(i), f64::from(sigma[*i])))));
        let nan = f64::NAN;
        Ok(Figures {
            points: measured.len(),
            coverage: self.coverage(depth, truth),
            gross: all.map_or(nan, |d| d.gross_error_rate),
            beyond: stated.map_or(nan, |stated| stated.beyond_5_sigma),
            gross_kinds: gross_kinds(measured.iter().filter(|i| error(i) > GROSS_MM), truth),
            inlier_rmse_mm: all.map_or(nan, |d| d.inlier_rmse_mm),
            mae_mm: all.map_or(nan, |d| d.mae_mm),
            cmae_mm: section.map_or(nan, |d| d.mae_mm),
            surface_mm: [distances.surface[0], distances.surface[1]],
            surface_p95_mm: distances.surface[2],
            points_mm: distances.points,
            floor_mm: distances.floor,
        })
    }

    fn coverage(&self, depth: &[f32], truth: &Truth) -> f64 {
        let wanted = Truth::SEEN | Truth::LIT | Truth::SQUARE;
        let smooth = |i: &&usize| truth.flags[**i] & (wanted | Truth::CREASE) == wanted;
        let (mut all, mut found) = (0.0, 0.0);
        for &i in self.on.iter().filter(smooth) {
            all += 1.0;
            found += f64::from(u8::from(depth[i].is_finite()));
        }
        found / all
    }

    fn distances(&self, depth: &[f32], truth: &Truth, measured: &[usize]) -> Result<Distances> {
        if measured.is_empty() || self.samples.is_empty() {
            return Ok(Distances::NONE);
        }
        let cloud = |depth: &[f32]| Cloud {
            points: (measured.iter())
                .map(|&i| self.point(i, depth[i]).as_vec3().to_array())
                .collect(),
            ..Cloud::default()
        };
        let points = cloud(depth);
        let to = measured.par_iter().filter_map(|&i| {
            let foot = self.tree.closest(self.point(i, depth[i]));
            foot.map(|foot| foot.distance_mm)
        });
        let there = Directed::of(to.collect());
        let perfect = Neighbours::new(&cloud(&truth.depth_mm).points);
        let nearest = Neighbours::new(&points.points);
        let surface = Surface::new(&phasmid_measure::Truth::Cloud(points))?;
        let feet = surface.closest_batch(&self.samples);
        let back = Directed::of(feet.iter().flatten().map(|foot| foot.distance_mm).collect());
        let surface = match (there, back) {
            (Some(a), Some(b)) => [
                a.hausdorff_mm.max(b.hausdorff_mm),
                (a.mae_mm + b.mae_mm) / 2.0,
                a.p95_mm.max(b.p95_mm),
            ],
            _ => [f64::NAN; 3],
        };
        Ok(Distances {
            surface,
            points: self.to_points(&nearest),
            floor: self.to_points(&perfect),
        })
    }

    /// Returns the largest and the mean distance from the true surface to the nearest of some points.
    fn to_points(&self, points: &Neighbours) -> [f64; 2] {
        let distance = |&p: &DVec3| {
            let found = points.nearest::<1>(p);
            found.as_slice().first().map(|(square, _)| square.sqrt())
        };
        let all = self.samples.par_iter().filter_map(distance).collect();
        Directed::of(all).map_or([f64::NAN; 2], |d| [d.hausdorff_mm, d.mae_mm])
    }
}

/// Counts pixels of each kind.
fn gross_kinds<'a>(pixels: impl Iterator<Item = &'a usize>, truth: &Truth) -> [usize; KINDS] {
    let mut counts = [0; KINDS];
    for &i in pixels {
        let has = |flag| truth.flags[i] & flag != 0;
        let kind = match () {
            () if !has(Truth::SQUARE) || has(Truth::UNRESOLVED) => 0,
            () if !has(Truth::LIT) => 1,
            () if has(Truth::CREASE) => 2,
            () => 3,
        };
        counts[kind] += 1;
    }
    counts
}

/// Returns the rows of trials whose keys start with `trials`.
pub(super) fn of<'a>(rows: &'a Rows, trials: &'a str) -> impl Iterator<Item = &'a Row> {
    let all = rows.all.iter();
    all.filter(move |row| row.get("trial").starts_with(trials))
}

/// Formats a number with three figures.
pub(super) fn three(value: f64) -> String {
    phasmid_report::plot::figures(value, 3)
}

/// Formats a fraction in per cent with two decimals.
pub(super) fn percent(share: f64) -> String {
    if share.is_finite() {
        format!("{:.2}", 100.0 * share + 0.0)
    } else {
        "-".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::super::bench::{bench, surface, trapezoid};
    use super::*;
    use phasmid_render::Renderer;

    /// Returns the mean distance from a point of a plane to the nearest point of a square lattice,
    /// relative to the lattice's spacing: the mean of sqrt(x^2 + y^2) over the unit square around the
    /// origin.
    fn lattice_floor() -> f64 {
        (2.0_f64.sqrt() + 1.0_f64.asinh()) / 6.0
    }

    /// All depths are off by a known distance.
    #[test]
    fn a_surface_that_is_off_is_as_far_off_as_it_is() {
        let profile = bench(1.0, Some([160, 129])).unwrap();
        let scene = trapezoid(1000.0).unwrap();
        let rig = profile.nominal_rig();
        let truth = Renderer::new(&profile, &scene, 1).unwrap().truth(&[]);
        let target = Target::new(&surface(&scene).unwrap(), &rig, &truth);
        let exact = target.figures(&truth.depth_mm, None, &truth).unwrap();
        assert_eq!((exact.mae_mm, exact.cmae_mm, exact.gross), (0.0, 0.0, 0.0));
        assert_eq!(exact.points_mm, exact.floor_mm);
        // With pixels of 1.5 mm, the mean distance on the top is the mean of a square lattice; on the
        // sides, which stretch the lattice, it is larger.
        let pitch = 920.0 / rig.camera.lens.focal_px.x;
        let [_, floor] = exact.floor_mm;
        assert!(
            (1.0..2.0).contains(&(floor / (lattice_floor() * pitch))),
            "{floor}"
        );

        let off: Vec<f32> = truth.depth_mm.iter().map(|z| z - 2.0).collect();
        // 2 mm are more than five times 0.3 mm, and less than five times 0.5 mm.
        let sigma: Vec<f32> = (0..off.len()).map(|i| [0.3, 0.5][i % 2]).collect();
        let found = target.figures(&off, Some(&sigma), &truth).unwrap();
        assert!((found.beyond - 0.5).abs() < 0.01, "{}", found.beyond);
        assert!((found.mae_mm - 2.0).abs() < 1e-4 && (found.cmae_mm - 2.0).abs() < 1e-4);
        assert_eq!((found.gross, found.points), (1.0, exact.points));
        // 2 mm along the top's normal, and 2 mm times the sine of the slope on the sides.
        let [largest, mean] = found.surface_mm;
        // The limit is the distance of the exact points, plus 2 mm of depth along the rays, plus one
        // pixel pitch, because other discs are now the nearest.
        let most = exact.surface_mm[0] + 2.2 + pitch;
        assert!((2.0 - 1e-3..most).contains(&largest), "{largest} {most}");
        let lean = 2.0 * 50.0 / 80.0_f64.hypot(50.0);
        assert!((lean..2.0).contains(&mean), "{mean}");

        // Only every other column is measured, without errors.
        let half: Vec<f32> = (0..truth.depth_mm.len())
            .map(|i| {
                if i % 2 == 0 {
                    truth.depth_mm[i]
                } else {
                    f32::NAN
                }
            })
            .collect();
        let found = target.figures(&half, None, &truth).unwrap();
        assert!((found.coverage - 0.5).abs() < 0.01, "{found:?}");
        assert_eq!((found.mae_mm, found.gross), (0.0, 0.0));
        let none = target
            .figures(&vec![f32::NAN; half.len()], None, &truth)
            .unwrap();
        assert!(none.points == 0 && none.coverage == 0.0 && none.mae_mm.is_nan());
    }
}
