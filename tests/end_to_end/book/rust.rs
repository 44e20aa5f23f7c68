//! Rust code in the book and the README is copied from the examples, which run in tests.

use super::{blocks, pages, text};
use std::path::PathBuf;

#[test]
fn rust_code_is_that_of_the_examples() {
    let mut copied = 0;
    // Pages for developers of the project quote its sources.
    let public = |page: &PathBuf| !page.starts_with("docs/src/inside");
    for page in pages().into_iter().filter(public) {
        for block in blocks(&page).iter().filter(|b| b.language() == "rust") {
            let page = page.display();
            let name = block.info.iter().find_map(|w| w.strip_prefix("example="));
            let name = name.unwrap_or_else(|| panic!("{page}: a block without example=NAME"));
            let code = text(&PathBuf::from(format!("examples/{name}.rs")));
            let inside = code.contains(block.text.trim_end());
            assert!(inside, "{page}: not in examples/{name}.rs:\n{}", block.text);
            copied += 1;
        }
    }
    assert!(copied >= 4, "{copied}");
}

#[test]
fn the_book_lists_every_example() {
    let page = text(&PathBuf::from("docs/src/guides/library.md"));
    let folder = super::root().join("examples");
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().path();
        let name = name.file_stem().unwrap().to_string_lossy().into_owned();
        assert!(
            page.contains(&format!("| `{name}` |")),
            "{name} is not listed"
        );
    }
}
