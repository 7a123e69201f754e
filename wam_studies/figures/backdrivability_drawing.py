"""Drawing of figure 3.2.6."""

from pathlib import Path

import numpy as np

from wam_studies.figures.backdrivability import BackdrivabilityMap
from wam_studies.figures.style import picture


def draw(numbers: BackdrivabilityMap, file: Path) -> None:
    """Maps over the angles of joints 2 and 4."""
    pitch, elbow = np.degrees(numbers.pitch), np.degrees(numbers.elbow)
    with picture(file, 10.0, 3.2) as figure:
        axes = figure.subplots(1, 3, sharey=True)
        for place, title, values, levels in (
            (axes[0], "a) least over greatest effective mass", numbers.isotropy, np.linspace(0.0, 0.6, 13)),
            (axes[1], "b) rotors' share of the effective mass", numbers.rotor_share, np.linspace(0.0, 0.24, 13)),
            (axes[2], "c) push that moves no joint [N]", numbers.friction, np.linspace(2.0, 6.0, 9)),
        ):
            drawn = place.contourf(pitch, elbow, values, levels=levels, cmap="viridis", extend="max")
            figure.colorbar(drawn, ax=place)
            place.set(title=title, xlabel=r"$\theta_2$ [°]")
        axes[0].set_ylabel(r"$\theta_4$ [°]")
