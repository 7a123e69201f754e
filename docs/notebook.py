"""Notebooks without Jupyter: run them, keep what they print and draw, show them on the site.

    python docs/notebook.py docs/notebooks/*.ipynb     # run and keep the outputs

Each code cell is run as Jupyter would, in the folder of the notebook: what it prints, the value of its last line,
then its figures.
"""

import ast
import base64
import contextlib
import io
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DPI = 100


def run(notebook: dict[str, Any]) -> dict[str, Any]:
    """The notebook with the outputs of its cells, which are run in order, in the working directory."""
    names: dict[str, Any] = {"__name__": "__main__"}
    cells = []
    for number, cell in enumerate(notebook["cells"], start=1):
        found = {}
        if cell["cell_type"] == "code":
            found = {"execution_count": number, "outputs": list(outputs("".join(cell["source"]), names, number))}
        cells.append({**cell, **found})
    return {**notebook, "cells": cells}


def outputs(source: str, names: dict[str, Any], number: int) -> Iterator[dict[str, Any]]:
    """What a cell prints, the value of its last line, its figures."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot

    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, f"cell {number}", "exec"), names)
        value = None
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), f"cell {number}", "eval"), names)
    if printed.getvalue():
        yield {"output_type": "stream", "name": "stdout", "text": printed.getvalue().splitlines(keepends=True)}
    figures = [pyplot.figure(figure) for figure in pyplot.get_fignums()]
    if value is not None and not figures:
        data = {"text/plain": repr(value).splitlines(keepends=True)}
        yield {"output_type": "execute_result", "execution_count": number, "metadata": {}, "data": data}
    for figure in figures:
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=DPI, bbox_inches="tight", metadata={"Software": None})
        data = {"image/png": base64.b64encode(picture.getvalue()).decode()}
        yield {"output_type": "display_data", "metadata": {}, "data": data}
    pyplot.close("all")


def printed_by(notebook: dict[str, Any]) -> list[str]:
    """The texts of all outputs."""
    every = [output for cell in notebook["cells"] for output in cell.get("outputs", [])]
    texts = [output.get("text") or output.get("data", {}).get("text/plain") for output in every]
    return ["".join(text) for text in texts if text]


def markdown_of(notebook: dict[str, Any]) -> str:
    """The notebook as a page."""
    parts = []
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                parts.append(f"![What the cell draws](data:image/png;base64,{data['image/png']})")
            else:
                text = "".join(output.get("text") or data.get("text/plain", ""))
                parts.append(f"```text\n{text.rstrip()}\n```")
    return "\n\n".join(parts) + "\n"


def read(file: Path) -> dict[str, Any]:
    """A notebook."""
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def main() -> None:
    """Run notebooks in their own folders, as Jupyter does, and keep their outputs."""
    for file in [Path(name).resolve() for name in sys.argv[1:]]:
        os.chdir(file.parent)
        file.write_text(json.dumps(run(read(file)), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(file.relative_to(ROOT))


with contextlib.suppress(ImportError):  # Sphinx is needed for the site alone
    from myst_parser.parsers.sphinx_ import MystParser

    class NotebookParser(MystParser):
        """Sphinx's parser of notebooks."""

        supported = ("notebook",)

        def parse(self, inputstring: str, document: Any) -> None:
            """Parse a notebook as the page that it is."""
            super().parse(markdown_of(json.loads(inputstring)), document)


if __name__ == "__main__":
    sys.exit(main())
