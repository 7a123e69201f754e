"""The documentation site builds without a warning and a network, its links lead somewhere, its notebooks run."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
NEEDED = ("sphinx", "myst_parser", "numpydoc", "furo")
MISSING = [name for name in NEEDED if importlib.util.find_spec(name) is None]

sys.path.insert(0, str(ROOT / "docs"))
import notebook  # noqa: E402


class Links(HTMLParser):
    """Targets and anchors of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: set[str] = set()
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if "id" in given:
            self.anchors.add(given["id"])
        if tag in ("a", "img", "script", "link", "source"):
            self.targets |= {given[name] for name in ("href", "src") if given.get(name)}


def dead_links(folder: Path) -> list[str]:
    """Links between the files of a site that lead nowhere."""
    pages = {}
    for path in folder.rglob("*.html"):
        pages[path] = Links()
        pages[path].feed(path.read_text(encoding="utf-8"))
    dead = []
    for path, links in pages.items():
        for target in links.targets:
            if re.match(r"[a-z]+:|//", target):
                continue
            named, _, anchor = target.partition("#")
            file = (path.parent / unquote(named.partition("?")[0])).resolve() if named else path
            if not file.exists() or (anchor and file in pages and unquote(anchor) not in pages[file].anchors):
                dead.append(f"{path.relative_to(folder)}: {target}")
    return sorted(dead)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site with the API reference, as `make site` builds it; every warning is an error."""
    if MISSING:
        pytest.skip(f"not installed: {', '.join(MISSING)}; pip install -c constraints.txt '.[docs]'")
    shutil.rmtree(ROOT / "docs" / "api", ignore_errors=True)  # pages of modules that are no longer there
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-P", "-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-j", "2"]
    environment = {**os.environ, "https_proxy": "http://127.0.0.1:9", "http_proxy": "http://127.0.0.1:9"}
    done = subprocess.run(
        [*command, "-d", str(folder / "doctrees"), str(ROOT / "docs"), str(folder / "html")],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "html"


@pytest.mark.slow
def test_no_link_of_the_site_is_dead(site: Path) -> None:
    assert dead_links(site) == []
    assert (site / "search.html").is_file()
    assert {path.stem for path in (ROOT / "docs").glob("*.md")} <= {path.stem for path in site.glob("*.html")}


@pytest.mark.slow
def test_the_site_requests_nothing_from_the_network(site: Path) -> None:
    for path in site.rglob("*.html"):
        loaded = re.findall(
            r"<(?:script|img|iframe)[^>]+src=\"(https?:)?//|<link[^>]+stylesheet[^>]+https?://", path.read_text()
        )
        assert not loaded, path


def test_a_dead_link_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<a href="b.html#here">b</a><a href="b.html#gone">b</a><a href="c.html">c</a>')
    (tmp_path / "b.html").write_text('<p id="here"></p>')
    assert dead_links(tmp_path) == ["a.html: b.html#gone", "a.html: c.html"]


# notebooks


@pytest.mark.slow
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_prints_what_it_shows(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    shown = notebook.read(file)
    assert notebook.printed_by(notebook.run(shown)) == notebook.printed_by(shown), f"run docs/notebook.py {file}"


def test_there_are_notebooks_that_print_and_draw() -> None:
    assert len(NOTEBOOKS) >= 2
    for file in NOTEBOOKS:
        shown: dict[str, Any] = notebook.read(file)
        assert notebook.printed_by(shown)
        assert "data:image/png" in notebook.markdown_of(shown)
