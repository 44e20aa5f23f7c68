//! Stacks slices into a grid, or reports why they do not form one.

use super::slice::Slice;
use crate::volume::{Grid, Volume, Voxels};
use glam::{DMat3, DVec3};
use phasmid_core::error::{Error, Result};
use rayon::prelude::*;

/// Maximum difference of a slice distance from the typical slice distance, as a fraction of the typical
/// distance.
const UNEVEN: f64 = 0.02;

/// Maximum slice distance in units of the slice thickness: some scanners leave gaps, but narrower
/// than a slice.
const WIDEST: f64 = 1.75;

/// Maximum lateral offset of slices from the line through the first, as a fraction of a pixel.
const ASIDE: f64 = 0.1;

/// Slices closer than this are duplicates, in millimetres.
const SAME_MM: f64 = 1e-3;

/// Slices sorted along their normal.
#[derive(Debug)]
pub(super) struct Stack {
    pub(super) grid: Grid,
    pub(super) slices: Vec<Slice>,
}

impl Stack {
    /// Sorts and checks slices.
    pub(super) fn of(mut slices: Vec<Slice>) -> Result<Self> {
        alike(&slices)?;
        let normal = normal(&slices[0]);
        let height = |slice: &Slice| slice.position_mm.dot(normal);
        slices.sort_by(|a, b| height(a).total_cmp(&height(b)).then(a.path.cmp(&b.path)));
        if slices.len() < 2 {
            return Err(Error::input(
                slices[0].place(),
                format!("one slice of series {}", slices[0].title()),
                "two or more: a volume",
            ));
        }
        upright(&slices)?;
        let heights: Vec<f64> = slices.iter().map(height).collect();
        even(&slices, &heights)?;
        let count = slices.len() - 1;
        let spacing = (heights[count] - heights[0]) / count as f64;
        adjoining(&slices[0], spacing)?;
        Self::checked(slices, spacing)
    }

    /// Creates a stack of one slice with the given thickness.
    pub(super) fn alone(slice: Slice, thickness_mm: f64) -> Result<Self> {
        Self::checked(vec![slice], thickness_mm)
    }

    fn checked(slices: Vec<Slice>, spacing: f64) -> Result<Self> {
        let first = &slices[0];
        let [ni, nj] = first.size;
        let [i_mm, j_mm] = first.spacing_mm;
        let [i, j] = first.along;
        let grid = Grid {
            size: [ni, nj, slices.len()],
            spacing_mm: DVec3::new(i_mm, j_mm, spacing),
            origin_mm: first.position_mm,
            direction: DMat3::from_cols(i, j, normal(first)),
        };
        let grid = grid.checked(&first.place().to_string())?;
        Ok(Self { grid, slices })
    }

    /// Reads the pixels, in Hounsfield units. They are stored as integers if all values are integers.
    pub(super) fn volume(&self) -> Result<Volume> {
        let read: Vec<Result<Vec<f32>>> = self.slices.par_iter().map(reread).collect();
        let mut voxels = Vec::with_capacity(self.grid.voxels());
        for slice in read {
            voxels.extend(slice?);
        }
        let whole = |x: &f32| x.fract() == 0.0 && x.abs() <= f32::from(i16::MAX);
        let voxels = if voxels.par_iter().all(whole) {
            Voxels::I16(voxels.par_iter().map(|&x| x as i16).collect())
        } else {
            Voxels::F32(voxels)
        };
        Volume::new(self.grid, voxels, &self.slices[0].place().to_string())
    }
}

/// Reads the pixels of a slice; fails if its header has changed.
fn reread(slice: &Slice) -> Result<Vec<f32>> {
    let (again, pixels) = Slice::read(&slice.path)?;
    if again == *slice {
        return Ok(pixels);
    }
    Err(Error::device(format!(
        "{}: the file has changed while it was read",
        slice.place()
    )))
}

fn normal(slice: &Slice) -> DVec3 {
    slice.along[0].cross(slice.along[1]).normalize()
}

/// Rejects slices that differ in patient, frame of reference, size, spacing or orientation.
fn alike(slices: &[Slice]) -> Result<()> {
    let first = &slices[0];
    for slice in slices {
        let differs = |what: &str, here: String, there: String| {
            Err(Error::input(
                slice.place(),
                format!("{what} {here}"),
                format!("the {what} of {}: {there}", first.place()),
            ))
        };
        if slice.patient != first.patient {
            return differs("patient", slice.patient.clone(), first.patient.clone());
        }
        if slice.frame != first.frame {
            return differs(
                "frame of reference",
                slice.frame.clone(),
                first.frame.clone(),
            );
        }
        if slice.size != first.size {
            let words = |s: &Slice| format!("{} x {} pixels", s.size[0], s.size[1]);
            return differs("size", words(slice), words(first));
        }
        let [a, b] = [slice, first].map(|s| DVec3::new(s.spacing_mm[0], s.spacing_mm[1], 0.0));
        if (a - b).length() > 1e-4 * b.length() {
            let words = |v: DVec3| format!("{} x {} mm", v.x, v.y);
            return differs("pixel spacing", words(a), words(b));
        }
        let turned = |n: usize| (slice.along[n] - first.along[n]).length() > 1e-4;
        if turned(0) || turned(1) {
            let words = |s: &Slice| format!("{}, {}", s.along[0], s.along[1]);
            return differs("orientation", words(slice), words(first));
        }
    }
    Ok(())
}

/// Rejects slices that are not on the line through the first slice along its normal. With a tilted
/// gantry, the couch moves obliquely to the images.
fn upright(slices: &[Slice]) -> Result<()> {
    let first = &slices[0];
    let normal = normal(first);
    let pixel = first.spacing_mm[0].min(first.spacing_mm[1]);
    for slice in slices {
        let way = slice.position_mm - first.position_mm;
        let aside = (way - way.dot(normal) * normal).length();
        if aside > ASIDE * pixel {
            let tilt = match slice.tilt_deg {
                0.0 => String::new(),
                tilt => format!(", a gantry tilt of {tilt} deg"),
            };
            return Err(Error::input(
                slice.place(),
                format!(
                    "a slice shifted sideways by {aside:.3} mm from that of {}{tilt}",
                    first.place()
                ),
                "slices stacked along their normal: no gantry tilt, no shift",
            ));
        }
    }
    Ok(())
}

/// Rejects slices much thinner than their distance: every second slice may be missing.
fn adjoining(slice: &Slice, spacing: f64) -> Result<()> {
    match slice.thickness_mm {
        Some(mm) if mm > 0.0 && spacing > WIDEST * mm => Err(Error::input(
            slice.place(),
            format!("slices of {mm} mm every {spacing:.3} mm: some are missing"),
            format!("slices at most {WIDEST} times their thickness apart"),
        )),
        _ => Ok(()),
    }
}

/// Rejects duplicated and missing slices and uneven distances.
fn even(slices: &[Slice], heights: &[f64]) -> Result<()> {
    let steps: Vec<f64> = heights.windows(2).map(|h| h[1] - h[0]).collect();
    if let Some(at) = steps.iter().position(|&mm| mm < SAME_MM) {
        return Err(Error::input(
            slices[at + 1].place(),
            format!("a second slice at the position of {}", slices[at].place()),
            "one slice at each position: one series, one phase",
        ));
    }
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    for (at, &mm) in steps.iter().enumerate() {
        if (mm - usual).abs() <= UNEVEN * usual {
            continue;
        }
        let times = (mm / usual).round();
        let missing = times >= 2.0 && (mm - times * usual).abs() <= UNEVEN * mm;
        let found = match (missing, times as u64) {
            (true, 2) => "a slice missing".to_owned(),
            (true, n) => format!("{} slices missing", n - 1),
            _ => format!("a distance of {mm:.3} mm"),
        };
        return Err(Error::input(
            slices[at + 1].place(),
            format!("{found} between it and {}", slices[at].place()),
            format!("a slice every {usual:.3} mm, as for the others"),
        ));
    }
    Ok(())
}
