"""Settings of Sphinx: the documentation site, built from these pages and the docstrings without a network.

Links point to files, as in the repository.  Pages of `OUTSIDE` are empty files here until their text is read.
"""

import builtins
import gc
import re
import sys
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpydoc.docscrape_sphinx
from docutils import nodes
from jinja2 import FileSystemBytecodeCache
from jinja2.sandbox import SandboxedEnvironment
from sphinx import addnodes
from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE), str(ROOT)]

from notebook import NotebookParser  # noqa: E402

OUTSIDE = {
    "project/samples": "bags/README.md",
    "project/speed": "benchmarks/README.md",
    "project/contributing": "CONTRIBUTING.md",
    "project/changelog": "CHANGELOG.md",
}
(HERE / "project").mkdir(exist_ok=True)
for page in OUTSIDE:
    (HERE / f"{page}.md").touch()
PACKAGES = sorted(path.parent.name for path in ROOT.glob("wam_*/__init__.py"))
LINK = re.compile(r"\]\((?P<path>[^)#:\s]+)(?P<anchor>#[^)]*)?\)")

project = "wam_stack"
author = "wam_stack maintainers"
copyright = "wam_stack maintainers, Apache-2.0"  # noqa: A001
html_title = "wam_stack"
html_theme = "furo"
html_show_sphinx = False
html_static_path = ["_static"]
html_css_files = ["site.css"]

extensions = ["myst_parser", "sphinx.ext.apidoc", "sphinx.ext.autodoc", "numpydoc"]
source_suffix = {".rst": "restructuredtext", ".md": "markdown", ".ipynb": "notebook"}
exclude_patterns = ["_build", "api/*/modules.rst"]
nitpicky = True
# types of numpy, ROS and MuJoCo in signatures: their documentation is not on this machine
nitpick_ignore_regex = [("py:.*", ".*")]

myst_heading_anchors = 3
myst_links_external_new_tab = False
apidoc_modules = [
    {"path": f"../{package}", "destination": f"api/{package}", "separate_modules": False, "max_depth": 3}
    for package in PACKAGES
]
autodoc_default_options = {"members": True, "show-inheritance": True, "member-order": "bysource"}
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_use_type_comments = False  # there are none; looking for them reads each source again
# the sidebar of every page copies the contents of all pages: with objects in them that took a third of the build
toc_object_entries = False
# a mock has no `|`, so what is installed is imported
OPTIONAL = ("rclpy", "control_msgs", "viser", "trimesh", "distributed", "websockets")
autodoc_mock_imports = [name for name in OPTIONAL if find_spec(name) is None]
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
# numpydoc has an environment for each docstring, and would compile its template for each
numpydoc.docscrape_sphinx.SandboxedEnvironment = partial(SandboxedEnvironment, bytecode_cache=FileSystemBytecodeCache())


def text_of(app: Sphinx, docname: str, source: list[str]) -> None:
    """The text of a page that is elsewhere, and links as the site needs them."""
    page = ROOT / OUTSIDE.get(docname, f"docs/{docname}.md")
    if page.is_file():
        text = page.read_text(encoding="utf-8") if docname in OUTSIDE else source[0]
        source[0] = LINK.sub(lambda found: f"]({target(page.parent, found['path'])}{found['anchor'] or ''})", text)


def target(folder: Path, path: str) -> str:
    """A link of a page in this folder, as a link of the site: to a page, to a file, or to the list of samples."""
    file = (folder / path).resolve()
    named = file.relative_to(ROOT).as_posix() if file.is_relative_to(ROOT) else path
    for docname, outside in OUTSIDE.items():
        if named == outside or (ROOT / outside).parent == file:
            return f"/{docname}.md"
    if file.is_dir():
        return "/project/samples.md"
    return f"/{file.relative_to(HERE).as_posix()}" if file.is_relative_to(HERE) else f"/{Path('..') / named}"


def plain_docstring(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Show the table of contents of a package as it is written, and '|x|' as the magnitude that it is."""
    if what == "module" and name in PACKAGES and lines and not any(line.startswith("===") for line in lines):
        lines[1:] = ["", "::", "", *(f"    {line}" for line in lines[1:])]
        return
    for i, line in enumerate(lines):
        parts = line.split("``")  # every second one is code
        parts[::2] = [part.replace("|", "\\|").replace("/**", "/\\**") for part in parts[::2]]
        lines[i] = "``".join(parts)


def without_others(app: Sphinx, doctree: nodes.document) -> None:
    """Do not link a builtin type, as `bytes`, to a field of ours with its name; nor search ours for types of others."""
    for reference in list(doctree.findall(addnodes.pending_xref)):
        package, dot, _ = reference["reftarget"].partition(".")
        is_others = package in sys.modules and package not in PACKAGES if dot else hasattr(builtins, package)
        if reference.get("refdomain") == "py" and is_others:
            reference.replace_self(reference.children)


def setup(app: Sphinx) -> None:
    """Connect the above."""
    gc.set_threshold(100_000)  # the trees of all pages stay: looking through them for garbage takes long
    app.add_source_parser(NotebookParser)
    app.connect("source-read", text_of)
    app.connect("autodoc-process-docstring", plain_docstring, priority=400)
    app.connect("doctree-read", without_others)
