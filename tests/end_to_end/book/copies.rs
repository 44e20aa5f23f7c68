//! Parts of the book's pages that are copies of source files. Between `<!-- copy of PATH -->` and
//! `<!-- end of copy -->`, a page contains the text of the file, so that the page looks the same on
//! a web site that renders Markdown and in the built book.

use super::{assert_generated, pages, root, text};
use std::path::Path;

const END: &str = "<!-- end of copy -->";

/// Returns the page with each copy renewed, and the number of copies.
fn renewed(page: &str) -> (String, usize) {
    let mut parts = page.split("<!-- copy of ");
    let mut out = parts.next().unwrap_or_default().to_owned();
    let mut count = 0;
    for part in parts {
        let (path, rest) = part.split_once(" -->").expect("a path");
        let (_, rest) = rest.split_once(END).expect("an end of the copy");
        let file = text(Path::new(path));
        let file = match path.rsplit_once('.') {
            Some((_, "py")) => format!("```python\n{}\n```", file.trim_end()),
            _ => file.trim_end().to_owned(),
        };
        out += &format!("<!-- copy of {path} -->\n\n{file}\n\n{END}{rest}");
        count += 1;
    }
    (out, count)
}

#[test]
fn copies_of_source_files_are_current() {
    let mut count = 0;
    let book = root().join("docs/src");
    for page in pages() {
        let Ok(name) = root().join(&page).strip_prefix(&book).map(Path::to_owned) else {
            continue;
        };
        let old = text(&page);
        let (new, copies) = renewed(&old);
        if copies > 0 {
            assert_generated(name.to_str().unwrap(), &new);
        }
        assert!(
            !old.contains("{{#"),
            "{}: mdBook includes show nothing elsewhere",
            name.display()
        );
        count += copies;
    }
    assert_eq!(count, 5);
}
