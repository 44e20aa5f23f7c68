//! The command-line program as users run it: one or several processes, and the files that they
//! write.

#[path = "../support/served.rs"]
mod served;

mod bad_day;
mod bench_command;
mod book;
mod calibrate_command;
mod decode_command;
mod demo;
mod exit_status;
mod factory_calibration;
mod held;
mod licences;
mod nominal_rigs;
mod other_process;
mod outputs;
mod overwrite;
mod patient_import;
mod progress;
mod serve;
mod soak;
mod weighted;
