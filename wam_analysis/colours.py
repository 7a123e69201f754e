"""One meaning per colour in every picture: true, estimated, commanded, measured; and those of the drawn scene."""

from typing import Final

# distinguishable with colour blindness
COMMANDED, TRUE, MEASURED, ESTIMATED = "#222222", "#0072b2", "#009e73", "#d55e00"
COLOURS: Final = {"commanded": COMMANDED, "true": TRUE, "measured": MEASURED, "estimated": ESTIMATED}
TUBE_COLOURS: Final = ("#5d6670", "#87919c")
BLOCK_COLOUR: Final = "#ecca88"
PEDESTAL_COLOUR: Final = "#c9ced4"


def channels(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of '#rrggbb'."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue
