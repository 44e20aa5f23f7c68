//! Writes a self-contained HTML page, without scripts or external resources.

use super::document::{Block, Check, Document, Image, Table};
use super::folder::Folder;
use super::markdown::checks_table;
use crate::plot::{PAGE_STYLE, STYLE, escaped};
use phasmid_core::error::{Error, Result};

/// Returns a page of one study, or of several with a table of contents. Each part consists of a
/// document, the folder with its images, and a line that says how the document was made. Each part
/// begins with the question and the verdict.
///
/// # Errors
/// Returns an error if an image cannot be read.
pub fn page(title: &str, parts: &[(Document, &Folder, String)]) -> Result<String> {
    let heading = escaped(title);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width\"/>\n<title>{heading}</title>\n\
         <style>{PAGE_STYLE}{STYLE}</style>\n</head>\n<body>\n<h1>{heading}</h1>\n"
    );
    if parts.len() > 1 {
        let entries = parts.iter().enumerate().map(|(i, (document, ..))| {
            let verdict = document.verdict().unwrap_or_default();
            format!(
                "<li><a href=\"#part{i}\">{}</a> {}</li>\n",
                escaped(&document.title),
                escaped(&verdict)
            )
        });
        out += &format!("<ul>\n{}</ul>\n", entries.collect::<String>());
    }
    for (i, (document, folder, made)) in parts.iter().enumerate() {
        if parts.len() > 1 {
            out += &format!("<h1 id=\"part{i}\">{}</h1>\n", escaped(&document.title));
        }
        out += &format!("<p>{}</p>\n", escaped(&document.asked));
        out += &of_checks(document);
        out += &format!("<p class=\"note\">{}</p>\n", escaped(made));
        for section in &document.sections {
            let body: Result<String> = section
                .blocks
                .iter()
                .map(|block| html(block, folder))
                .collect();
            let (title, body) = (escaped(&section.title), body?);
            if !body.is_empty() {
                out += &format!("<section>\n<h2>{title}</h2>\n{body}</section>\n");
            }
        }
    }
    Ok(out + "</body>\n</html>\n")
}

fn html(block: &Block, folder: &Folder) -> Result<String> {
    Ok(match block {
        Block::Words(words) => format!("<p>{}</p>\n", escaped(words)),
        Block::Table(table) if table.rows.is_empty() => String::new(),
        Block::Table(table) => of_table(table),
        // The checks are already at the top of the document.
        Block::Checks(_) => String::new(),
        Block::Figure(figure) => {
            let element = figure.sheet.clone().into_element(&figure.caption);
            let caption = escaped(&figure.caption);
            format!("<div class=\"wide\">{element}</div>\n<p class=\"note\">{caption}</p>\n")
        }
        Block::Image(image) => of_image(image, folder)?,
    })
}

/// Returns the verdict, and the checks, which are folded if all have passed.
fn of_checks(document: &Document) -> String {
    let Some(verdict) = document.verdict() else {
        return String::new();
    };
    let open = match document.checks().all(Check::passed) {
        true => "",
        false => " open",
    };
    let table = of_table(&checks_table(&document.by_verdict()));
    format!(
        "<details{open}><summary><b>{}</b></summary>\n{table}</details>\n",
        escaped(&verdict)
    )
}

fn of_table(table: &Table) -> String {
    let row = |cells: &[String], tag: &str| {
        let cells = cells
            .iter()
            .map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell)));
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let body: String = table.rows.iter().map(|cells| row(cells, "td")).collect();
    let caption = if table.caption.is_empty() {
        String::new()
    } else {
        format!("<p>{}</p>\n", escaped(&table.caption))
    };
    let head = row(&table.header, "th");
    format!("{caption}<div class=\"wide\"><table>\n{head}{body}</table></div>\n")
}

fn of_image(image: &Image, folder: &Folder) -> Result<String> {
    let bytes = folder.left(&image.file)?;
    if let Err(e) = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png) {
        let place = folder.files().join(&image.file);
        return Err(Error::input(
            place.display(),
            e,
            "the PNG that a trial has left",
        ));
    }
    let data = base64(&bytes);
    let caption = escaped(&image.caption);
    Ok(format!(
        "<figure class=\"large\"><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"/>\
         <figcaption class=\"note\">{caption}</figcaption></figure>\n"
    ))
}

/// Encodes bytes in Base64 (RFC 4648, section 4).
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let at = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let word = at(0) << 16 | at(1) << 8 | at(2);
        for i in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= three.len() {
                char::from(letter)
            } else {
                '='
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::base64;

    /// Test vectors of RFC 4648, section 10.
    #[test]
    fn base64_matches_rfc_4648() {
        let words = ["", "f", "fo", "foo", "foob", "fooba", "foobar"];
        let texts = [
            "", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy",
        ];
        assert_eq!(words.map(|word| base64(word.as_bytes())), texts);
    }
}
