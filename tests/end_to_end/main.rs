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

/// Returns a mask of signals from the status of a process: `SigIgn:` for ignored ones, `SigCgt:`
/// for handled ones. Bit 0 is signal 1.
#[cfg(target_os = "linux")]
fn signals(process: u32, name: &str) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix(name));
    u64::from_str_radix(mask.unwrap().trim(), 16).unwrap()
}

/// Returns the signal of Ctrl-C, or TERM as [`or_term`] does.
#[cfg(target_os = "linux")]
fn interrupt() -> rustix::process::Signal {
    or_term(rustix::process::Signal::INT)
}

/// Returns the signal, or TERM if the tests ignore the signal, as in the background of a shell
/// script or under `nohup`: processes that they start then ignore it too.
#[cfg(target_os = "linux")]
fn or_term(signal: rustix::process::Signal) -> rustix::process::Signal {
    match signals(std::process::id(), "SigIgn:") >> (signal.as_raw() - 1) & 1 {
        0 => signal,
        _ => rustix::process::Signal::TERM,
    }
}
