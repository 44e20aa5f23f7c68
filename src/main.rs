//! The command line's entry: everything is in the library, except for what happens when memory runs
//! out.

mod out_of_memory;

use std::process::ExitCode;

fn main() -> ExitCode {
    phasmid::cli::main()
}
