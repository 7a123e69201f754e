"""Tables of text, for a terminal and for Markdown."""

import textwrap
from collections.abc import Collection, Iterable, Sequence

Cells = Sequence[str]


def plain(
    head: Sequence[Cells], rows: Sequence[Cells], left: Collection[int] = (0,), first: int = 0, least: int = 0
) -> list[str]:
    """Lines of a table for a terminal, each column as wide as it needs, two blanks apart.

    Parameters
    ----------
    head : cells of each line of the head.
    rows : cells of each row.
    left : columns that are aligned to the left.
    first : width at which the first column is wrapped; 0 for never.
    least : least width of every column but the first.
    """
    lines: list[Cells] = [*head]
    for name, *rest in rows:
        start, *more = (textwrap.wrap(name, first, subsequent_indent="  ") if first else []) or [name]
        lines += [[start, *rest], *([line, *[""] * len(rest)] for line in more)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    widths = [widths[0], *(max(width, least) for width in widths[1:])]
    return [
        "  ".join(
            cell.ljust(width) if i in left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]


def markdown(head: Cells, rows: Iterable[Cells]) -> str:
    """A table of Markdown, with the line end of its last row."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(map(_cell, line)) + " |\n" for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
