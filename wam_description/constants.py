"""Every constant of the MIT/WAM arm and of the testbed, with its source or the reason for which it is assumed."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

from wam_description.units import si


@dataclass(frozen=True)
class Constant:
    """One row of `constants.yaml`.

    Attributes
    ----------
    meaning : the quantity and its part.
    value : number or numbers in `unit`, as printed; corrected if `erratum` is not empty.
    unit : as printed, a key of `units.FACTORS`.
    symbol : the thesis's letter, or the closest one.
    source : section, table or equation of what is printed, or computed from printed numbers alone.
    reason : for the value, where it is not printed.
    parameter : dotted name in ``config/`` with this value; empty if there is none.
    index : elements of the parameter that it covers; empty for all.
    erratum : what is wrong in print; empty if nothing is.
    """

    meaning: str
    value: float | list[float]
    unit: str
    symbol: str = ""
    source: str = ""
    reason: str = ""
    parameter: str = ""
    index: tuple[int, ...] = ()
    erratum: str = ""

    @property
    def si(self) -> tuple[float, ...]:
        """The value or values in SI units."""
        values = self.value if isinstance(self.value, list) else [self.value]
        return tuple(si(value, self.unit) for value in values)


@cache
def constants(arm: str) -> tuple[Constant, ...]:
    """The constants of an arm, 'wam' or 'testbed', in the order of `constants.yaml`."""
    rows = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))[arm]
    return tuple(Constant(**row) for row in rows)
