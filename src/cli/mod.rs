//! The command line: one module per command, each with a `clap` struct `Args` and a function `run`.
//!
//! Modules that several commands share:
//!
//! | module | contents |
//! | --- | --- |
//! | `board_args` | options that describe a calibration board |
//! | `decoding` | `--held`, and warnings and errors about decoding |
//! | `help` | groups of commands, completions, man pages |
//! | `interrupt` | Ctrl-C and TERM during a capture |
//! | `method` | `--method`, from projector coordinates to points |
//! | `options` | `--set`, `--backend`, and options with three numbers |
//! | `output` | standard output and standard error, and messages about an emulated device |
//! | `pods` | options that select the pods of a station, and their scans |
//! | `progress` | progress on a terminal, with the remaining time |
//! | `without_link` | stand-in for commands that need Linux |

#[macro_use]
mod output;

mod bench;
mod board;
mod board_args;
mod calibrate;
mod camera;
mod compare;
#[cfg(feature = "console")]
mod console;
mod decode;
mod decoding;
#[cfg(target_os = "linux")]
mod demo;
mod dialect;
#[cfg(target_os = "linux")]
mod doctor;
mod faults;
mod help;
mod interrupt;
mod launcher;
mod locate;
mod method;
mod options;
mod patient;
mod plan;
mod pods;
mod profile;
mod progress;
mod record;
#[cfg(target_os = "linux")]
mod replay;
mod report;
mod scan;
mod scene;
#[cfg(feature = "schema")]
mod schema;
mod sequence;
#[cfg(target_os = "linux")]
mod serve;
mod study;
mod track;
#[cfg(not(target_os = "linux"))]
mod without_link;
#[cfg(not(target_os = "linux"))]
use {without_link as demo, without_link as doctor, without_link as replay, without_link as serve};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
pub use launcher::Launcher;
use output::{STANDARD_OUTPUT, unheard};
use phasmid_core::error::{Error, Result};
use std::ffi::OsString;
use std::io::Write;

/// The `phasmid` program.
#[derive(Debug, Parser)]
#[command(name = "phasmid", version, about, long_about = None)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Serve(serve::Args),
    Scan(scan::Args),
    Record(record::Args),
    Replay(replay::Args),
    Camera(camera::Args),
    Decode(decode::Args),
    Calibrate(calibrate::Args),
    Compare(compare::Args),
    #[command(visible_alias = "station")]
    Profile(profile::Args),
    Sequence(sequence::Args),
    Dialect(dialect::Args),
    Scene(scene::Args),
    Patient(patient::Args),
    Locate(locate::Args),
    Track(track::Args),
    Plan(plan::Args),
    Bench(bench::Args),
    Board(board::Args),
    Doctor(doctor::Args),
    Faults(faults::Args),
    Study(study::Args),
    Report(report::Args),
    #[cfg(feature = "console")]
    Console(console::Args),
    #[cfg(feature = "schema")]
    Schema(schema::Args),
    Completions(help::CompletionsArgs),
    Man(help::ManArgs),
}

/// Runs a command and returns the exit status: 0 for success, 1 for a failure of a device or the system,
/// 2 for invalid input. The first argument is the name of the program. Results go to standard output,
/// messages to standard error.
///
/// Run one command per process: once a capture has begun, SIGINT, SIGTERM and SIGHUP are handled for the
/// rest of the process, and the process ends at a second signal or if standard output is closed.
///
/// ```
/// use phasmid::cli::{self, Launcher};
/// assert_eq!(cli::main(["phasmid", "profile", "show", "nobody"], &Launcher::default()), 2);
/// ```
pub fn main(arguments: impl IntoIterator<Item = impl Into<OsString>>, launcher: &Launcher) -> u8 {
    let parsed =
        help::command(Cli::command()).parse(arguments.into_iter().map(Into::into).collect());
    let status = match parsed.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => match dispatch(cli.command, launcher) {
            Ok(()) => 0,
            Err(Error::Io { place, source }) if place == STANDARD_OUTPUT => unheard(&source),
            Err(error) => {
                eprintln!("phasmid: {error}");
                error.exit_code()
            }
        },
        // A usage error, or the text of --help or --version.
        Err(answer) => {
            if let Err(e) = answer.print()
                && !answer.use_stderr()
            {
                unheard(&e);
            }
            u8::try_from(answer.exit_code()).unwrap_or(2)
        }
    };
    // Flush standard output, which may hold a last line without a newline. At the end of a Python
    // process, no other code would do this.
    if let Err(e) = std::io::stdout().flush() {
        unheard(&e);
    }
    status
}

/// Starts the worker threads now. If the system refuses threads, this returns an error, whereas the
/// first parallel computation would panic.
fn start_threads() -> Result<()> {
    use std::error::Error as _;
    let started = rayon::ThreadPoolBuilder::new().build_global();
    // An error without a source means that the threads are already running.
    match started.as_ref().err().and_then(|why| why.source()) {
        None => Ok(()),
        Some(why) => Err(Error::device(format!(
            "threads of parallel work: {why}; expected more memory, a higher limit (ulimit -v, \
             ulimit -u, a container's), or fewer threads (RAYON_NUM_THREADS)"
        ))),
    }
}

fn dispatch(command: Command, launcher: &Launcher) -> Result<()> {
    start_threads()?;
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Serve(args) => serve::run(&args),
        Command::Scan(args) => scan::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Camera(args) => camera::run(&args),
        Command::Decode(args) => decode::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Profile(args) => profile::run(&args),
        Command::Sequence(args) => sequence::run(&args),
        Command::Dialect(args) => dialect::run(&args),
        Command::Scene(args) => scene::run(&args),
        Command::Patient(args) => patient::run(&args),
        Command::Locate(args) => locate::run(&args),
        Command::Track(args) => track::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Board(args) => board::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Faults(args) => faults::run(&args),
        Command::Study(args) => study::run(&args, launcher),
        Command::Report(args) => report::run(&args, launcher),
        #[cfg(feature = "console")]
        Command::Console(args) => console::run(&args),
        #[cfg(feature = "schema")]
        Command::Schema(args) => schema::run(&args),
        Command::Completions(args) => help::completions(&args, Cli::command()),
        Command::Man(args) => help::man(&args, Cli::command()),
    }
}
