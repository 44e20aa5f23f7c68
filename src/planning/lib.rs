//! Patient data: image volumes and their file formats, the skin as an iso-surface, the planning
//! folder and the import of clinical data into one. Depends on `phasmid-core` and
//! `phasmid-geometry` only.
//!
//! | module | contents |
//! | --- | --- |
//! | [`dicom`] | DICOM CT series and 4D-CT |
//! | [`import`] | planning folder from clinical data |
//! | [`isosurface`] | surface of a volume at a level, such as the skin |
//! | [`metaimage`] | MetaImage volumes and displacement fields |
//! | [`planning`] | the planning folder |
//! | [`volume`] | scalar volumes and displacement fields on a grid |
//!
//! The patient frame is DICOM's LPS in millimetres: x to the patient's left, y to posterior, z to
//! the head. Scanner files use the scanner's own LPS; [`planning`] and `phantom` return data with
//! the origin at the planning isocentre.

pub mod dicom;
pub mod import;
pub mod isosurface;
pub mod metaimage;

pub mod planning;
pub mod volume;
