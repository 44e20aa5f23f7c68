//! Checks that links of the README and the book lead to existing files and headings.

use super::{pages, parser, root, text};
use pulldown_cmark::{Event, Tag, TagEnd};
use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};

/// Removes `.` and `..` from a path, as a browser does.
fn normalised(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => assert!(out.pop(), "{}", path.display()),
            Component::CurDir => {}
            _ => out.push(part),
        }
    }
    out
}

/// Returns the anchors of a page's headings, made as mdBook and GitHub do.
fn anchors(text: &str) -> HashSet<String> {
    let mut counts = HashMap::new();
    let mut anchors = HashSet::new();
    let mut heading: Option<String> = None;
    for event in parser(text) {
        match event {
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::Text(part) | Event::Code(part) => {
                if let Some(heading) = &mut heading {
                    heading.push_str(&part);
                }
            }
            Event::End(TagEnd::Heading(_)) => {
                let kept = heading.take().unwrap().to_lowercase();
                let kept = kept.trim().chars().filter_map(|c| match c {
                    ' ' => Some('-'),
                    c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
                    _ => None,
                });
                let id: String = kept.collect();
                let count = counts.entry(id.clone()).or_insert(0);
                anchors.insert(match *count {
                    0 => id,
                    n => format!("{id}-{n}"),
                });
                *count += 1;
            }
            _ => {}
        }
    }
    anchors
}

/// Returns the targets of links and images.
fn targets(text: &str) -> Vec<String> {
    parser(text)
        .filter_map(|event| match event {
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                Some(dest_url.into_string())
            }
            _ => None,
        })
        .collect()
}

#[test]
fn links_and_anchors_resolve() {
    let mut broken = Vec::new();
    for page in pages() {
        for target in targets(&text(&page)) {
            // Included code documentation also has links to items.
            if target.starts_with("https://") || target.starts_with("crate::") {
                continue;
            }
            let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let path = match file {
                "" => page.clone(),
                file => normalised(&page.parent().unwrap().join(file)),
            };
            let outside = page.starts_with("docs") && !path.starts_with("docs/src");
            let found = !outside
                && root().join(&path).is_file()
                && (anchor.is_empty() || anchors(&text(&path)).contains(anchor));
            if !found {
                broken.push(format!("{}: {target}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "broken links:\n{}", broken.join("\n"));
}

#[test]
fn the_summary_lists_every_page_once() {
    let summary = Path::new("docs/src/SUMMARY.md");
    let mut listed: Vec<PathBuf> = targets(&text(summary))
        .iter()
        .map(|target| Path::new("docs/src").join(target))
        .collect();
    listed.sort();
    let book: Vec<PathBuf> = pages()
        .into_iter()
        .filter(|page| page.starts_with("docs") && page != summary)
        .collect();
    assert_eq!(listed, book);
}
