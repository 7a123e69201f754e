"""What the pictures and the live page share: one meaning per colour, one style, and sizes that no parameter has."""

from typing import Any, Final

# distinguishable with colour blindness
COMMANDED, TRUE, MEASURED, ESTIMATED = "#222222", "#0072b2", "#009e73", "#d55e00"
PREDICTED: Final = "#6b7280"  # by theory
LIKELY: Final = "#f2a11a"  # where a contact may be
HAND: Final = "#7a3db8"  # of the user who drags a link
INK: Final = "#222222"  # text and axes
# shafts, axes and other things side by side; none of the meanings above
SHAFTS: Final = ("#7b3f9e", "#c2410c", "#0f766e", "#a16207", "#be185d", "#4d7c0f", "#475569", "#1d4ed8")
COLOURS: Final = {"commanded": COMMANDED, "true": TRUE, "measured": MEASURED, "estimated": ESTIMATED}
TUBE_COLOURS: Final = ("#5d6670", "#87919c")
BLOCK_COLOUR: Final = "#ecca88"
OBJECT_COLOUR: Final = "#5f93bd"
PEDESTAL_COLOUR: Final = "#c9ced4"


# of matplotlib; 9 points are readable where a picture of up to 9 inches fills a page
STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.formatter.useoffset": False,  # numbers as they are, not what is to be added to one in a corner
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
}


def channels(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of '#rrggbb'."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue
