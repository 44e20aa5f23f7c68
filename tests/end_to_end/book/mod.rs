//! The README and the book in `docs`: every command runs, every TOML example parses, every link and
//! anchor resolves, and generated pages are up to date.

mod commands;
mod copies;
mod crates;
mod examples;
mod fields;
mod figures;
mod flags;
mod links;
mod run;
mod rust;
#[cfg(feature = "schema")]
mod schemas;

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};
use std::path::{Path, PathBuf};

/// A fenced code block: the words of its info string, and its text.
struct Block {
    info: Vec<String>,
    text: String,
}

impl Block {
    /// Returns the file name of a block marked `file=NAME`.
    fn file(&self) -> Option<&str> {
        self.info.iter().find_map(|word| word.strip_prefix("file="))
    }

    fn language(&self) -> &str {
        self.info.first().map_or("", String::as_str)
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the pages as paths relative to the repository: README.md and the Markdown files in
/// `docs/src`, sorted.
fn pages() -> Vec<PathBuf> {
    let mut found = vec![PathBuf::from("README.md")];
    let mut folders = vec![root().join("docs/src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                found.push(path.strip_prefix(root()).unwrap().to_owned());
            }
        }
    }
    found.sort();
    found
}

/// Returns the text of a file in the repository.
fn text(page: &Path) -> String {
    let path = root().join(page);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn parser(text: &str) -> Parser<'_> {
    Parser::new_ext(text, Options::ENABLE_TABLES)
}

/// Returns the fenced code blocks of a page, in order.
fn blocks(page: &Path) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for event in parser(&text(page)) {
        match event {
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(info))) => {
                open = Some(Block {
                    info: info.split_whitespace().map(str::to_owned).collect(),
                    text: String::new(),
                });
            }
            Event::Text(text) => {
                if let Some(block) = &mut open {
                    block.text.push_str(&text);
                }
            }
            Event::End(TagEnd::CodeBlock) => blocks.extend(open.take()),
            _ => {}
        }
    }
    blocks
}

/// Compares a generated page with the file in `docs/src`. With `PHASMID_BLESS=1` in the environment
/// the file is written instead.
fn assert_generated(page: &str, expected: &str) {
    let path = root().join("docs/src").join(page);
    if std::env::var("PHASMID_BLESS").is_ok_and(|v| v == "1") {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    let differs = found
        .lines()
        .zip(expected.lines())
        .position(|(a, b)| a != b);
    assert!(
        found == expected,
        "docs/src/{page} is out of date (line {}); run the test with PHASMID_BLESS=1",
        differs.map_or(found.lines().count().min(expected.lines().count()), |i| i) + 1
    );
}
