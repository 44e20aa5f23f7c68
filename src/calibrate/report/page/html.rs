//! Functions that build HTML elements.

use phasmid_report::plot::escaped;

/// A cell with text.
pub(super) fn cell(text: &str) -> String {
    format!("<td>{}</td>", escaped(text))
}

/// A left-aligned cell with text.
pub(super) fn words(text: &str) -> String {
    format!("<td class=\"words\">{}</td>", escaped(text))
}

/// A table from column names and rows of finished cells.
pub(super) fn table(columns: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let names: String = columns
        .iter()
        .map(|name| format!("<th>{}</th>", escaped(name)))
        .collect();
    let mut out = format!("<div class=\"wide\"><table>\n<tr>{names}</tr>\n");
    for row in rows {
        out.push_str(&format!("<tr>{}</tr>\n", row.concat()));
    }
    out.push_str("</table></div>\n");
    out
}

/// A paragraph in small type that explains the content beside it.
pub(super) fn note(text: &str) -> String {
    format!("<p class=\"note\">{}</p>\n", escaped(text))
}

/// URL of a file in the page's folder. Every byte that could have a special meaning is written as
/// %XX (RFC 3986, section 2.1); "./" prevents a colon from ending a scheme.
pub(super) fn address(file: &str) -> String {
    let mut out = "./".to_owned();
    for byte in file.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.~/".contains(&byte) {
            out.push(char::from(byte));
        } else {
            out.push_str(&format!("%{byte:02X}"));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_relative_and_escaped() {
        assert_eq!(address("found_a.png"), "./found_a.png");
        assert_eq!(
            address("javascript:\"a b\"?#ü"),
            "./javascript%3A%22a%20b%22%3F%23%C3%BC"
        );
    }

    #[test]
    fn cells_are_escaped() {
        let text = table(&["<a>"], [vec![cell("<b>"), words("&")]]);
        assert!(text.contains("<th>&lt;a&gt;</th>"));
        assert!(text.contains("<td>&lt;b&gt;</td><td class=\"words\">&amp;</td>"));
    }
}
