//! `phasmid board`: writes a calibration board to print, as an SVG whose unit is the millimetre.
//!
//! The sheet lies at the top of the page. Below it is a strip with one line of text that describes
//! the board, and a ruler to check the printer's scale. On a chessboard, the strip overlaps the
//! sheet's own white margin as far as there is room, so the default chessboard leaves the 5 mm on
//! all sides of A4 that printers need. Lengths are written in the shortest decimal form that parses
//! to the same number.

use super::board_args::BoardArgs;
use glam::DVec2;
use phasmid_core::error::Result;
use phasmid_core::new_file;
use phasmid_geometry::Board;
use std::fmt::Write as _;
use std::io::Write;
use std::path::PathBuf;

/// Height of the strip below the sheet.
const STRIP_MM: f64 = 10.0;
const RULER_MM: f64 = 100.0;
/// White gap between the squares and the strip.
const CLEAR_MM: f64 = 2.5;
/// Distance from the page's edge to the ruler and the text.
const MARGIN_MM: f64 = 5.0;
/// Minimum width of the page in millimetres, so that the line of text fits.
const TEXT_MM: f64 = 150.0;

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
        out.write_all(page(&board).as_bytes())
    })?;
    let size = page_mm(&board);
    println!(
        "{}: {} x {} mm; print at 100 % scale, and check the length of the ruler",
        args.out.display(),
        size.x,
        size.y
    );
    Ok(())
}

/// Returns the width and height of the page in millimetres. The page is as wide as the sheet, and at
/// least as wide as the text and the ruler.
fn page_mm(board: &Board) -> DVec2 {
    let sheet = board.sheet_mm();
    let shared = match board {
        // The sheet has a white margin of half a square.
        Board::Chess { pitch_mm, .. } => (pitch_mm / 2.0 - CLEAR_MM).clamp(0.0, STRIP_MM),
        Board::Dots { .. } => 0.0,
    };
    DVec2::new(sheet.x.max(TEXT_MM), sheet.y + STRIP_MM - shared)
}

/// Returns the contents of the SVG file.
fn page(board: &Board) -> String {
    let DVec2 {
        x: width,
        y: height,
    } = page_mm(board);
    let middle = DVec2::new(width, board.sheet_mm().y) / 2.0;
    let mut svg = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" \
         viewBox=\"0 0 {width} {height}\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    let pattern = match board {
        Board::Dots { .. } => dots(board, middle),
        Board::Chess { .. } => squares(board, middle),
    };
    let _ = write!(svg, "<g fill=\"black\">\n{pattern}</g>\n");
    svg.push_str(&strip(board, height - STRIP_MM));
    svg.push_str("</svg>\n");
    svg
}

fn dots(board: &Board, middle: DVec2) -> String {
    let dot = |index| {
        let (at, r) = (middle + board.point(index), board.radius_mm(index));
        format!("<circle cx=\"{}\" cy=\"{}\" r=\"{r}\"/>\n", at.x, at.y)
    };
    board.indices().map(dot).collect()
}

/// Draws the dark squares, with the same colours as in [`Board::ink`].
fn squares(board: &Board, middle: DVec2) -> String {
    let ([columns, rows], side) = (board.grid(), board.pitch_mm());
    let first = middle + board.point([0, 0]) - side;
    let mut svg = String::new();
    for row in 0..=rows {
        for column in (0..=columns).filter(|column| (column + row).is_multiple_of(2)) {
            let at = first + DVec2::new(column.into(), row.into()) * side;
            let (x, y) = (at.x, at.y);
            let _ = writeln!(
                svg,
                "<rect x=\"{x}\" y=\"{y}\" width=\"{side}\" height=\"{side}\"/>"
            );
        }
    }
    svg
}

/// Draws the strip below the height `top`: a description of the board, and the ruler.
fn strip(board: &Board, top: f64) -> String {
    let [columns, rows] = board.grid();
    let about = match board {
        Board::Dots {
            pitch_mm,
            dot_mm,
            marker_mm,
            ..
        } => format!(
            "phasmid board of dots: {columns} x {rows}, pitch {pitch_mm} mm, dots {dot_mm} mm, \
             markers {marker_mm} mm"
        ),
        Board::Chess { pitch_mm, .. } => {
            format!("phasmid chessboard: {columns} x {rows} inner corners, squares {pitch_mm} mm")
        }
    };
    let (left, right) = (MARGIN_MM, MARGIN_MM + RULER_MM);
    let (line, text) = (top + 6.5, top + 3.5);
    let ticks: String = (0..=10)
        .map(|k| {
            let x = left + RULER_MM * f64::from(k) / 10.0;
            let end = line + if k % 5 == 0 { 2.0 } else { 1.0 };
            format!("M{x} {line}V{end}")
        })
        .collect();
    format!(
        "<text x=\"{left}\" y=\"{text}\" font-family=\"sans-serif\" font-size=\"3\">{about}; \
         ruler {RULER_MM} mm</text>\n\
         <path d=\"M{left} {line}H{right}{ticks}\" fill=\"none\" stroke=\"black\" \
         stroke-width=\"0.2\"/>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the values of the named attributes for each element of this type, in order.
    fn all(svg: &str, element: &str, names: &[&str]) -> Vec<Vec<f64>> {
        let open = format!("<{element} ");
        let of = |text: &str| {
            let tag = text.split('>').next().unwrap();
            let value = |name: &&str| {
                let rest = tag.split(&format!(" {name}=\"")).nth(1);
                rest.map_or(0.0, |r| r.split('"').next().unwrap().parse().unwrap())
            };
            names.iter().map(value).collect()
        };
        svg.split(&open)
            .skip(1)
            .map(|text| format!(" {text}"))
            .map(|text| of(&text))
            .collect()
    }

    /// Returns a function that tests whether a point of the page is black.
    fn is_black(svg: &str) -> impl Fn(DVec2) -> bool {
        let discs = all(svg, "circle", &["cx", "cy", "r"]);
        let squares = all(svg, "rect", &["x", "y", "width", "height"]);
        move |p| {
            let in_disc = |c: &Vec<f64>| (p.x - c[0]).hypot(p.y - c[1]) <= c[2];
            let within = |x: f64, low: f64, wide: f64| low <= x && x < low + wide;
            // The first rectangle is the page's background.
            let mut of_board = squares.iter().skip(1);
            discs.iter().any(in_disc)
                || of_board.any(|s| within(p.x, s[0], s[2]) && within(p.y, s[1], s[3]))
        }
    }

    #[test]
    fn printed_page_has_the_ink_of_the_board() {
        let odd = Board::Dots {
            columns: 8,
            rows: 7,
            pitch_mm: 3.3,
            dot_mm: 1.1,
            marker_mm: 2.2,
        };
        for board in [Board::DOTS, odd, Board::CHESS, Board::CHESS.scaled(0.3)] {
            let svg = page(&board);
            let (page, sheet) = (page_mm(&board), board.sheet_mm());
            let size = format!("width=\"{}mm\" height=\"{}mm\"", page.x, page.y);
            let view = format!("viewBox=\"0 0 {} {}\"", page.x, page.y);
            assert!(svg.contains(&size) && svg.contains(&view));
            let is_black = is_black(&svg);
            let middle = DVec2::new(page.x, sheet.y) / 2.0;
            let mut black = 0;
            for k in 0..20_000 {
                let place = |root: f64| (f64::from(k) * root.sqrt() + 0.123).fract();
                let p = page * DVec2::new(place(2.0), place(3.0));
                let wanted = board.ink(p - middle, DVec2::ZERO, DVec2::ZERO) > 0.5;
                assert_eq!(is_black(p), wanted, "{board:?} at {p}");
                black += u32::from(wanted);
            }
            assert!(black > 100, "{black}");
        }
    }

    #[test]
    fn strip_of_text_describes_board_and_ruler() {
        let svg = page(&Board::DOTS.scaled(4.0));
        let about = "25 x 19, pitch 24 mm, dots 10 mm, markers 20 mm; ruler 100 mm</text>";
        assert!(svg.contains(about), "{svg}");
        assert!(svg.contains("M5 486.5H105M5"), "{svg}");
        let svg = page(&Board::CHESS);
        assert!(svg.contains("9 x 6 inner corners, squares 25 mm;"));
        // On A4 paper (297 mm x 210 mm), this page leaves at least 5 mm on all sides.
        assert_eq!(page_mm(&Board::CHESS), DVec2::new(275.0, 200.0));
        // The squares end at a height of 187.5 mm. The letters begin 3 mm above their baseline,
        // which is at 193.5 mm.
        assert!(svg.contains("<text x=\"5\" y=\"193.5\" "), "{svg}");
        assert!(page_mm(&Board::DOTS).cmplt(DVec2::new(210.0, 297.0)).all());
    }
}
