//! `phasma board`: a calibration board to print.

mod svg;

use super::board_args::BoardArgs;
use crate::error::{Error, Result};
use std::path::PathBuf;

/// Write a calibration board to print: an SVG at true scale
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    board: BoardArgs,
    /// The SVG file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite a file that is there
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// Boards that cannot be, a file that is there, what the system refuses.
pub(super) fn run(args: &Args) -> Result<()> {
    let board = args.board.board(1.0)?;
    if args.out.exists() && !args.force {
        return Err(Error::input(
            args.out.display(),
            "a file that is there",
            "another file, or --force to overwrite",
        ));
    }
    std::fs::write(&args.out, svg::page(&board)).map_err(|e| Error::io(&args.out, e))?;
    let page = svg::page_mm(&board);
    println!(
        "{}: {} x {} mm; print it at 100 %, and measure its ruler",
        args.out.display(),
        page.x,
        page.y
    );
    Ok(())
}
