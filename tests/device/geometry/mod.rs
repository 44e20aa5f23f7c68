//! The geometry pass compared with closed forms, for ordinary and for extreme inputs.

mod closed_form;
mod exact;
mod extremes;
mod hold;
mod samples;
