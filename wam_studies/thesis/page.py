"""The page of the documentation with the results of every experiment."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from wam_analysis.table import markdown
from wam_studies.page import kept_rows, section_of, with_section
from wam_studies.thesis.definition import Experiment
from wam_studies.thesis.rows import PAGE_HEAD, Result, summary

SECTION = "experiments"
HEAD = ("experiment", "within bounds", "nearest to its bound", *PAGE_HEAD[1:])


def write(page: Path, results: Sequence[tuple[Experiment, Result, Path]]) -> None:
    """Write a row and a picture of each experiment into a page, and keep the rows of others.

    Parameters
    ----------
    page : Markdown; pictures are copied into the folder with its name.
    results : experiments with their results and pictures; one without panels has none.
    """
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    before = section_of(page, SECTION)
    rows = kept_rows(before)
    pictures = {line.rpartition("/")[2]: line for line in before.splitlines() if line.startswith("![")}
    for experiment, result, picture in results:
        name = f"`{experiment.name}`"
        rows[name] = [name, *summary(result.rows)]
        if result.panels:
            shown = f"{folder.name}/{experiment.name}.png)"
            pictures[shown.rpartition("/")[2]] = f"![{experiment.title}]({shown}"
            shutil.copyfile(picture, folder / f"{experiment.name}.png")
    text = "\n\n".join([markdown(HEAD, list(rows.values())).rstrip(), *pictures.values()])
    page.write_text(with_section(page, SECTION, f"\n{text}", SECTION), encoding="utf-8")
