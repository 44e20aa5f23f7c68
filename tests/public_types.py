"""Checks that the library's entry points, and all types reached through their signatures and public
fields, use types of the workspace and of std only. Reads the pages that `cargo doc` has written.

Usage: public_types.py target/doc
"""

import html
import re
import sys
from pathlib import Path

FOREIGN = re.compile(
    r"\b(I?D?Vec[234]|D?Mat[234]|D?Quat|DMatrix|DVector|Matrix[1-6]|Vector[1-6]f|Rgb(a)?Image|GrayImage"
    r"|DynamicImage|ThreadPool|TempDir|JoinHandle|wgpu|tokio|rayon|serde_json|toml::Value)\b"
)
DECLARATION = re.compile(
    r'<(pre class="rust item-decl"|h4 class="code-header"|section id="variant|span id="structfield|span id="variant)'
    r".*?</(?:pre|h4|section|span)>",
    re.S,
)
TRAITS = re.compile(r'id="(?:trait-implementations|synthetic-implementations|blanket-implementations)"')
LINK = re.compile(r'href="((?:[^"#]*/)?(?:struct|enum|trait|type)\.\w+\.html)')


def declarations(page):
    """Yields the HTML of the declarations of a page, without implementations of traits."""
    own = TRAITS.split(page.read_text())[0]
    for found in DECLARATION.finditer(own):
        yield found.group(0)


def main(folder):
    root = Path(folder).resolve()
    waiting = sorted((root / "phasmid").glob("*.*.html"))
    seen, wrong = set(waiting), 0
    while waiting:
        page = waiting.pop()
        for declaration in declarations(page):
            text = html.unescape(re.sub(r"<[^>]*>", "", declaration))
            if FOREIGN.search(text):
                wrong += 1
                print(f"{page.relative_to(root)}: {' '.join(text.split())}")
            for link in LINK.findall(declaration):
                target = (page.parent / link).resolve()
                if target.exists() and target not in seen:
                    seen.add(target)
                    waiting.append(target)
    if len(seen) < 50:
        sys.exit(f"{folder}: only {len(seen)} pages; expected the documentation of the workspace")
    print(f"{len(seen)} pages, {wrong} signatures with types of other crates")
    sys.exit(wrong > 0)


main(sys.argv[1])
