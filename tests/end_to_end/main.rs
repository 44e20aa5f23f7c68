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
mod library_pool;
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

/// Returns a bit mask of signals from the status file of a process: ignored signals for `SigIgn:`,
/// handled signals for `SigCgt:`. Bit 0 is signal 1.
#[cfg(target_os = "linux")]
fn signals(process: u32, name: &str) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix(name));
    u64::from_str_radix(mask.unwrap().trim(), 16).unwrap()
}

/// Returns the signal that Ctrl-C sends, or TERM as [`or_term`] does.
#[cfg(target_os = "linux")]
fn interrupt() -> rustix::process::Signal {
    or_term(rustix::process::Signal::INT)
}

/// Returns the signal, or TERM if the tests ignore the signal. They do so in the background of a
/// shell script or under `nohup`; then the processes that they start ignore it too.
#[cfg(target_os = "linux")]
fn or_term(signal: rustix::process::Signal) -> rustix::process::Signal {
    match signals(std::process::id(), "SigIgn:") >> (signal.as_raw() - 1) & 1 {
        0 => signal,
        _ => rustix::process::Signal::TERM,
    }
}
