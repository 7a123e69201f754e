"""Style of the figures: sizes, colours, and a file that is written at the end."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wam_analysis.drawing import SHAFTS, STYLE

GREY = "#777777"
SHADES = (*SHAFTS[1:5], SHAFTS[0], *SHAFTS[5:])
DPI = 200


@contextmanager
def picture(file: Path, width: float, height: float, dpi: float = DPI) -> Iterator[Figure]:
    """A figure of this size, inches, which is written to the file at the end."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.savefig(file, dpi=dpi)


@contextmanager
def panels(
    file: Path, rows: int, columns: int, width: float, height: float, dpi: float = DPI
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure of this size, inches, with its axes row by row."""
    with picture(file, width, height, dpi) as figure:
        yield figure, list(figure.subplots(rows, columns, squeeze=False).ravel())
