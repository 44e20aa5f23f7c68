"""The programs of the book and of the README run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
BLOCK = re.compile(r"^```python (wheel|test)\n(.*?)^```", re.MULTILINE | re.DOTALL)

pytest_plugins = ["pytester"]


def programs(page: Path) -> dict[str, list[str]]:
    """Return the blocks of a page by their marks."""
    found: dict[str, list[str]] = {}
    for mark, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        found.setdefault(mark, []).append(text)
    return found


PAGES = [page for page in [ROOT / "README.md", *sorted((ROOT / "docs" / "src").rglob("*.md"))] if programs(page)]


def test_pages_are_found() -> None:
    assert {"README.md", "python.md"} <= {page.name for page in PAGES}
    assert {mark for page in PAGES for mark in programs(page)} == {"wheel", "test"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_programs_run_in_order(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for text in programs(page).get("wheel", []):
        exec(compile(text, str(page), "exec"), names)


@pytest.mark.parametrize("page", [page for page in PAGES if "test" in programs(page)], ids=lambda page: page.name)
def test_tests_pass(page: Path, pytester: pytest.Pytester) -> None:
    blocks = programs(page)["test"]
    for i, text in enumerate(blocks):
        pytester.path.joinpath(f"test_{i}.py").write_text(text)
    pytester.runpytest_subprocess().assert_outcomes(passed=len(blocks))
