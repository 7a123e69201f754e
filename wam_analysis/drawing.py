"""What the pictures and the live page share: one meaning per colour, and sizes that no parameter has."""

from typing import Final

# distinguishable with colour blindness
COMMANDED, TRUE, MEASURED, ESTIMATED = "#222222", "#0072b2", "#009e73", "#d55e00"
# shafts and axes side by side; none of the meanings above
SHAFTS: Final = ("#7b3f9e", "#c2410c", "#0f766e", "#a16207", "#be185d", "#4d7c0f", "#475569", "#1d4ed8")
COLOURS: Final = {"commanded": COMMANDED, "true": TRUE, "measured": MEASURED, "estimated": ESTIMATED}
TUBE_COLOURS: Final = ("#5d6670", "#87919c")
BLOCK_COLOUR: Final = "#ecca88"
OBJECT_COLOUR: Final = "#5f93bd"
PEDESTAL_COLOUR: Final = "#c9ced4"
PEDESTAL: Final = 0.07  # m, radius of the drawn base, which is not in the parameters
METRES_PER_NEWTON: Final = 0.015  # length of an arrow


def channels(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of '#rrggbb'."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue
