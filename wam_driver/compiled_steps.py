"""Steps of the plant in C, `fast_steps.c`, where the package was built with WAM_COMPILE."""

import ctypes
import importlib
from collections.abc import Callable
from functools import partial
from typing import Any

import mujoco

from wam_driver.surfaces import SHARPNESS, SMALLEST_DEPTH, SurfaceLaw

Advance = Callable[..., list[float]]  # see the docstring of `advance` in fast_steps.c, without its first argument


def compiled_steps(model: Any, data: Any, laws: list[SurfaceLaw], step: float) -> Advance | None:
    """What advances a plant in C; None where it has not been built, or for another MuJoCo.

    Parameters
    ----------
    model, data : of MuJoCo; they have to live as long as what is returned.
    laws : of `Surfaces`.
    step : of the plant, s.
    """
    try:
        built: Any = importlib.import_module("wam_driver.fast_steps")
        library = ctypes.CDLL(f"libmujoco.so.{mujoco.__version__}")  # which mujoco has loaded already
        functions = [library.mj_step1, library.mj_step2, library["_mjPRIVATE_setTlsLogHandler"]]
    except (ImportError, OSError, AttributeError):
        return None
    if mujoco.mj_version() != built.MUJOCO:
        return None
    addresses = [ctypes.cast(function, ctypes.c_void_p).value for function in functions]
    constants = (step, SMALLEST_DEPTH, float(SHARPNESS))
    fixed = (model._address, data._address, *addresses, mujoco.FatalError, laws, *constants)
    advance: Advance = partial(built.advance, fixed)
    return advance
