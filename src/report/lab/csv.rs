//! Reads and writes rows as lines of a CSV file (RFC 4180, with `\n`).

use super::row::Row;

/// Returns a line with these cells, quoted if necessary.
pub(super) fn line<'a>(cells: impl IntoIterator<Item = &'a str>) -> String {
    let quoted = cells.into_iter().map(|cell| {
        if cell.contains(['"', ',', '\n', '\r']) {
            format!("\"{}\"", cell.replace('"', "\"\""))
        } else {
            cell.to_owned()
        }
    });
    quoted.collect::<Vec<_>>().join(",") + "\n"
}

/// Splits a line, without its end, into cells; `None` if a quote is not closed or is inside an unquoted
/// cell.
pub(super) fn cells(line: &str) -> Option<Vec<String>> {
    let mut cells = vec![];
    let mut rest = line;
    loop {
        let (cell, after) = match rest.strip_prefix('"') {
            Some(quoted) => unquoted(quoted)?,
            None => {
                let end = rest.find(',').unwrap_or(rest.len());
                let cell = &rest[..end];
                if cell.contains('"') {
                    return None;
                }
                (cell.to_owned(), &rest[end..])
            }
        };
        cells.push(cell);
        match after.strip_prefix(',') {
            Some(more) => rest = more,
            None => return after.is_empty().then_some(cells),
        }
    }
}

/// Returns the text up to the closing quote, unescaped, and the rest of the line.
fn unquoted(text: &str) -> Option<(String, &str)> {
    let mut cell = String::new();
    let mut rest = text;
    loop {
        let end = rest.find('"')?;
        cell.push_str(&rest[..end]);
        rest = &rest[end + 1..];
        match rest.strip_prefix('"') {
            Some(more) => {
                cell.push('"');
                rest = more;
            }
            None => return Some((cell, rest)),
        }
    }
}

/// Formats a row as a line, with its cells in the order of the columns.
pub(super) fn row_line(row: &Row, columns: &[&str]) -> String {
    line(columns.iter().map(|name| row.get(name)))
}

/// Parses a line as a row; `None` if it does not have one cell per column.
pub(super) fn row_of(text: &str, columns: &[&str]) -> Option<Row> {
    let cells = cells(text)?;
    (cells.len() == columns.len()).then(|| {
        let pairs = columns.iter().zip(&cells);
        pairs.fold(Row::new(), |row, (name, cell)| row.text(name, cell))
    })
}
