//! Entry point of the command-line program. Everything is in the library, except the handling of
//! memory exhaustion.

mod out_of_memory;

use phasmid::cli::{self, Launcher};
use std::process::ExitCode;

fn main() -> ExitCode {
    let launcher = Launcher {
        program: std::env::current_exe().ok(),
        ..Launcher::default()
    };
    ExitCode::from(cli::main(std::env::args_os(), &launcher))
}
