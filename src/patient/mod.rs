//! Patients: the generated one.
//!
//! The patient frame is DICOM's LPS in millimetres (x to the patient's left, y to posterior, z to
//! the head) with its origin at the planning isocentre.

pub mod phantom;
