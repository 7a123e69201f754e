"""The page of the documentation with the results of every experiment."""

import re
import shutil
from collections.abc import Sequence
from pathlib import Path

from wam_studies.thesis.definition import Experiment
from wam_studies.thesis.rows import Result, markdown


def write(page: Path, results: Sequence[tuple[Experiment, Result, Path]]) -> None:
    """Write results into the blocks `<!-- experiment: NAME -->` ... `<!-- end -->` of a page.

    A new experiment gets a section of its own at the end.

    Parameters
    ----------
    page : Markdown; pictures are copied into the folder with its name.
    results : experiments with their results and pictures; one without panels has none.
    """
    content = page.read_text(encoding="utf-8")
    folder = page.parent / page.stem
    folder.mkdir(exist_ok=True)
    for experiment, result, picture in results:
        block = re.compile(rf"(<!-- experiment: {re.escape(experiment.name)} -->\n).*?(<!-- end -->)", re.DOTALL)
        if not block.search(content):
            content = (
                f"{content.rstrip()}\n\n## {experiment.title}\n\n<!-- experiment: {experiment.name} -->\n<!-- end -->\n"
            )
        text = _text(experiment, result, f"{folder.name}/{experiment.name}.png")
        content = block.sub(rf"\g<1>{_literal(text)}\g<2>", content)
        if result.panels:
            shutil.copyfile(picture, folder / f"{experiment.name}.png")
    page.write_text(content, encoding="utf-8")


def _text(experiment: Experiment, result: Result, picture: str) -> str:
    remarks = "".join(f"\n- {remark}" for remark in result.remarks)
    drawn = f"![{experiment.title}]({picture})\n\n" if result.panels else ""
    return f"\n{markdown(result.rows)}{remarks}\n\n{drawn}".replace("\n\n\n", "\n\n")


def _literal(text: str) -> str:
    """A text as replacement of a substitution."""
    return text.replace("\\", "\\\\")
