"""The page of documentation that shows what every experiment came to."""

import re
import shutil
from collections.abc import Sequence
from pathlib import Path

from wam_analysis.experiments.definition import Experiment
from wam_analysis.experiments.rows import Result, markdown


def write(page: Path, results: Sequence[tuple[Experiment, Result, Path]]) -> None:
    """Fill the blocks `<!-- experiment: NAME -->` ... `<!-- end -->` of a page; pictures go beside it.

    Parameters
    ----------
    page : Markdown; pictures go into the folder of its stem.
    results : experiments with their results and the pictures that were drawn.

    Raises
    ------
    ValueError
        where the page has no block for an experiment.
    """
    content = page.read_text(encoding="utf-8")
    folder = page.parent / page.stem
    folder.mkdir(exist_ok=True)
    for experiment, result, picture in results:
        block = re.compile(rf"(<!-- experiment: {re.escape(experiment.name)} -->\n).*?(<!-- end -->)", re.DOTALL)
        if not block.search(content):
            raise ValueError(
                f"{page} has no block '<!-- experiment: {experiment.name} -->'; add one, and '<!-- end -->'"
            )
        text = _text(experiment, result, f"{folder.name}/{experiment.name}.png")
        content = block.sub(rf"\g<1>{_literal(text)}\g<2>", content)
        shutil.copyfile(picture, folder / f"{experiment.name}.png")
    page.write_text(content, encoding="utf-8")


def _text(experiment: Experiment, result: Result, picture: str) -> str:
    remarks = "".join(f"\n- {remark}" for remark in result.remarks)
    return f"\n{markdown(result.rows)}{remarks}\n\n![{experiment.title}]({picture})\n\n".replace("\n\n\n", "\n\n")


def _literal(text: str) -> str:
    """A text for the right side of a substitution."""
    return text.replace("\\", "\\\\")
