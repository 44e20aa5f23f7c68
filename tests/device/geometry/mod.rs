//! The geometry pass against closed forms, at both ends of what it may be given.

mod closed_form;
mod exact;
mod extremes;
mod hold;
mod samples;
