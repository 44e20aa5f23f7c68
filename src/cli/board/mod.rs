//! `phasmid board`: writes a calibration board to print.

mod svg;

use super::board_args::BoardArgs;
use phasmid_core::error::Result;
use phasmid_core::new_file;
use std::io::Write;
use std::path::PathBuf;

/// Write a calibration board to print: an SVG at true scale
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid board --board chess --out chess.svg")]
pub(super) struct Args {
    #[command(flatten)]
    board: BoardArgs,
    /// SVG file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite an existing file
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// Returns an error if the board is invalid, the file exists and `--force` is missing, or the file
/// cannot be written.
pub(super) fn run(args: &Args) -> Result<()> {
    let board = args.board.board(1.0)?;
    new_file::write(&args.out, args.force, |out| {
        out.write_all(svg::page(&board).as_bytes())
    })?;
    let page = svg::page_mm(&board);
    println!(
        "{}: {} x {} mm; print it at 100 % scale, and measure its ruler",
        args.out.display(),
        page.x,
        page.y
    );
    Ok(())
}
