//! `phasmid board`: a calibration board to print.

mod svg;

use super::board_args::BoardArgs;
use phasmid_core::error::Result;
use phasmid_core::new_file;
use std::io::Write;
use std::path::PathBuf;

/// Write a calibration board to print: an SVG at true scale
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    board: BoardArgs,
    /// The SVG file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite an existing file
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// Boards that cannot be, an existing file, what the system refuses.
pub(super) fn run(args: &Args) -> Result<()> {
    let board = args.board.board(1.0)?;
    new_file::write(&args.out, args.force, |out| {
        out.write_all(svg::page(&board).as_bytes())
    })?;
    let page = svg::page_mm(&board);
    println!(
        "{}: {} x {} mm; print it at 100 %, and measure its ruler",
        args.out.display(),
        page.x,
        page.y
    );
    Ok(())
}
