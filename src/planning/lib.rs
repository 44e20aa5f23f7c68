//! Patients: volumes and their files, the skin as an iso-surface, the planning folder, what is
//! imported into one, and the generated ones.
//!
//! The patient frame is DICOM's LPS in millimetres: x to the patient's left, y to posterior, z to
//! the head. What a file of a scanner says stands in that scanner's own LPS; what
//! [`planning`] and `phantom` hand out has its origin at the planning isocentre.

pub mod dicom;
pub mod import;
pub mod isosurface;
pub mod metaimage;

pub mod planning;
pub mod volume;
