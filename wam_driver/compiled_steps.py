"""Steps of the plant in C, `fast_steps.c`, where the package was built with WAM_COMPILE."""

import ctypes
import importlib
from collections.abc import Callable
from functools import partial
from typing import Any, SupportsIndex

import mujoco

from wam_driver.circuits import CableCircuits
from wam_driver.dry_friction import DryFriction
from wam_driver.loads import AppliedPush
from wam_driver.surfaces import SurfaceLaw
from wam_driver.thresholds import PLANT

# `advance` of fast_steps.c, without its first argument
Advance = Callable[[SupportsIndex, bool, Callable[[], object]], list[float]]


def compiled_steps(
    model: Any,
    data: Any,
    laws: list[SurfaceLaw],
    friction: DryFriction,
    circuits: CableCircuits,
    pushes: dict[str, AppliedPush],
    step: float,
) -> Advance | None:
    """What advances a plant in C; None where it has not been built, or for another MuJoCo.

    Parameters
    ----------
    model, data : of MuJoCo; they have to live as long as what is returned.
    laws : of `Surfaces`.
    friction, circuits : of the plant.
    pushes : of `CoverLoads`.
    step : of the plant, s.
    """
    try:
        built: Any = importlib.import_module("wam_driver.fast_steps")
        library = ctypes.CDLL(f"libmujoco.so.{mujoco.__version__}")  # which mujoco has loaded already
        names = ("mj_step1", "mj_step2", "mj_applyFT", "_mjPRIVATE_setTlsLogHandler", "mjcb_time")
        found = [library[name] for name in names]
    except (ImportError, OSError, AttributeError):
        return None
    if mujoco.mj_version() != built.MUJOCO:
        return None
    addresses = [ctypes.cast(one, ctypes.c_void_p).value for one in found]
    each = circuits.each if circuits.depends_on_torque else []
    lists = (laws, *friction.bounds, friction.direction, each)
    constants = (step, PLANT.smallest_depth, float(PLANT.sharpness))
    prepared = built.prepare(
        model._address, data._address, *addresses, mujoco.FatalError, *lists, circuits, pushes, *constants
    )
    advance: Advance = partial(built.advance, prepared)
    return advance
