"""The result of a study as text: for a terminal, and between two marks of a page of the documentation."""

from pathlib import Path

from wam_analysis.table import markdown
from wam_studies.harness import Measurement
from wam_studies.scores import rows_table

LISTED = 40  # failed cases
END = "<!-- end of what is written -->"


def report(measured: Measurement, command: str) -> str:
    """The tables, and each failed case with the command that repeats it.

    Parameters
    ----------
    measured : records and their scores.
    command : without seeds, which repeats a case with these and its number.
    """
    scores, by_seed = measured.scores, measured.by_seed
    rows = rows_table(scores.rows, {seed: own.rows for seed, own in by_seed.items()}) if scores.rows else ""
    parts = [rows, *(table.text() for table in scores.tables)]
    failures = measured.failures
    lines = [
        f"* seed {seed}, case {number}: {reason}\n  `{command} --seeds {seed} --only {number}`"
        for seed, number, reason in failures[:LISTED]
    ]
    if len(failures) > LISTED:
        lines.append(f"* {len(failures) - LISTED} more")
    if lines:
        parts.append("## Failures\n\n" + "\n".join(lines) + "\n")
    return "\n".join(filter(None, parts))


def block(measured: Measurement, command: str, picture: str = "") -> str:
    """What is written into a page: when and how it was measured, the picture, what is required, and a page's tables.

    All tables and each failed case are in `report`.

    Parameters
    ----------
    command : that writes this.
    picture : its path relative to the page, '' for none.
    """
    count = len(measured.total)
    head = f"Written by `{command}`: {count} cases on {measured.date}, code and configuration `{measured.code}`."
    shown = f"![{measured.study.title}]({picture})" if picture else ""
    bounded = [row for row in measured.scores.rows if row.is_bounded]
    missed = sum(row.is_missed for row in bounded)
    verdict = f"Missed: {missed} of these required values." if missed else "Every required value is met."
    tables = [markdown(one.head, one.rows) for one in measured.scores.tables if one.is_in_page]
    return "\n\n".join(part.rstrip() for part in (head, shown, verdict, rows_table(bounded), *tables) if part)


def section_of(file: Path, name: str) -> str:
    """What a section of the page holds, '' where there is no page."""
    page = file.read_text(encoding="utf-8") if file.exists() else ""
    return page.partition(f"<!-- written: {name} -->\n")[2].partition(END)[0]


def kept_rows(text: str) -> dict[str, list[str]]:
    """Cells of each row of the tables in a section, by the first one, without the heads."""
    lines = [line for line in text.splitlines() if line[:2] == "| "]
    rows = [[cell.strip().replace("\\|", "|") for cell in f"{line} "[1:].split(" | ")[:-1]] for line in lines]
    parts = zip(rows, [*rows, [""]][1:], strict=True)
    return {row[0]: row for row, after in parts if not (row[0].startswith("---") or after[0].startswith("---"))}


def with_section(file: Path, name: str, text: str, title: str = "") -> str:
    """The page with one of its sections replaced; a new page of a title where there is none.

    Raises
    ------
    ValueError
        for a page without the section.
    """
    begin = f"<!-- written: {name} -->\n"
    page = file.read_text(encoding="utf-8") if file.exists() else f"# {title[:1].upper()}{title[1:]}\n\n{begin}{END}\n"
    before, _, rest = page.partition(begin)
    _, is_whole, after = rest.partition(END)
    if not is_whole:
        raise ValueError(f"{file} has no line '{begin.strip()}' before '{END}'; add both where the result belongs")
    return f"{before}{begin}{text.rstrip()}\n{END}{after}"
