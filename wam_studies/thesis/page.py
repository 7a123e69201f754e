"""The page of the documentation with the results of every experiment."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from wam_studies.page import END, section_of, with_section
from wam_studies.thesis.definition import Experiment
from wam_studies.thesis.rows import Result, markdown


def write(page: Path, results: Sequence[tuple[Experiment, Result, Path]]) -> None:
    """Write results into the sections of a page; a new experiment gets one at the end.

    Parameters
    ----------
    page : Markdown; pictures are copied into the folder with its name.
    results : experiments with their results and pictures; one without panels has none.
    """
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    for experiment, result, picture in results:
        parts = [markdown(result.rows), "\n".join(f"- {remark}" for remark in result.remarks)]
        if result.panels:
            parts.append(f"![{experiment.title}]({folder.name}/{experiment.name}.png)")
            shutil.copyfile(picture, folder / f"{experiment.name}.png")
        if not section_of(page, experiment.name):
            _append(page, experiment)
        text = with_section(page, experiment.name, "\n" + "\n\n".join(filter(None, map(str.strip, parts))))
        page.write_text(text, encoding="utf-8")


def _append(page: Path, experiment: Experiment) -> None:
    """Give a new experiment a section at the end."""
    before = page.read_text(encoding="utf-8").rstrip()
    section = f"## {experiment.title}\n\n<!-- written: {experiment.name} -->\n\n{END}\n"
    page.write_text(f"{before}\n\n{section}", encoding="utf-8")
