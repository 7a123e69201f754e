"""Steps of the plant in C, as WAM_COMPILE builds them, against the plain way: the same bits and the same failures."""

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from conftest import ran

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from simulation import installed

from wam_description.configuration import Configuration, packaged
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant

NAME = "wam_driver.fast_steps"
SOURCE = Path(__file__).parents[2] / "wam_driver" / "fast_steps.c"
COMPILER = str(sysconfig.get_config_var("CC")).split()[0]
INCLUDES = (sysconfig.get_path("include"), str(Path(mujoco.__file__).parent / "include"))

pytestmark = pytest.mark.skipif(
    not (shutil.which(COMPILER) and Path(INCLUDES[0], "Python.h").exists()), reason="needs a C compiler and Python.h"
)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The module, built from its source."""
    library = tmp_path_factory.mktemp("built") / f"fast_steps{sysconfig.get_config_var('EXT_SUFFIX')}"
    given = [f"-I{folder}" for folder in INCLUDES]
    flags = ["-shared", "-fPIC", "-O2", "-Wall", "-Werror", "-ffp-contract=off"]
    subprocess.run([COMPILER, *flags, *given, str(SOURCE), "-o", str(library)], check=True)
    spec = importlib.util.spec_from_file_location(NAME, library)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.modules.pop(NAME, None)  # where Python has put it: other tests are those of the plain way
    return module


@pytest.fixture
def with_c(built: Any, monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Plants are advanced in C until the fixture's patches are undone."""
    monkeypatch.setitem(sys.modules, NAME, built)
    return monkeypatch


def plant(name: str = "wam", **values: Any) -> Plant:
    """The plant of a configuration with these parameters of the driver."""
    changed = {f"driver:{key}": value for key, value in values.items()}
    configuration = Configuration.load(packaged(name)).with_values(changed)
    own = configuration.node("driver", DriverParameters)
    shared = configuration.shared
    return Plant(shared.arm, own.world, own.effects, shared.timing.substep, own.friction, own.brake_torque)


def history(made: Plant) -> bytes:
    """Every number of a run with motion both ways, rest, a push, a change of friction and brakes."""
    n = len(made.theta)
    rows = []
    made.brake(False)
    for k in range(900):
        if k == 300:
            made.push("outer_link" if n > 1 else "link", np.array([0.0, 12.0, 3.0]), np.array([0.0, 0.0, 3.0]))
        if k == 400 and n > 1:
            made.push("inner_link", np.array([1.0, 0.3, -7.0]), np.array([0.1, 0.0, 0.2]))
        if k == 500:
            made.release()
        if k == 600:
            made.set_added_friction([0.05] * n)
        made.brake(k > 800)
        made.step([0.4 * (1.0 if k % 200 < 90 else -1.0) * (k % 150 < 120)] * n, 1 + k % 3)
        rows += [made.theta, made.thetad, made.q, made.qd, made.strain_torque, made.cable_pull]
        rows += [made.data.plastic.tolist(), [made.data.ncon]]
    return repr(rows).encode()


CASES: dict[str, dict[str, Any]] = {
    "as configured": {},
    "no friction by tension": {"effects.tension_friction": (0.0,) * 4},
    "strands that go slack": {"effects.tension_friction": (1e-5,) * 4, "effects.pretension_share": (0.02,)},
    "two surfaces, one of them hardening": {
        "world.obstacles.names": ("bench", "foam"),
        "world.obstacles.shapes": ("box", "cylinder"),
        "world.obstacles.positions": (0.8, 0.0, 0.28, 0.45, 0.25, 0.6),
        "world.obstacles.rotations": (0.0,) * 6,
        "world.obstacles.sizes": (0.4, 0.4, 0.1, 0.1, 0.2, 0.0),
        "world.obstacles.stiffness": (4000.0, 900.0),
        "world.obstacles.damping": (20.0, 3.0),
        "world.obstacles.hardening": (0.0, 60.0),
        "world.obstacles.friction": (0.3, 0.8),
    },
    "no creep": {"effects.creep": False, "effects.tension_friction": (0.0,) * 4},
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_steps_have_the_bits_of_plain_python(case: str, with_c: pytest.MonkeyPatch) -> None:
    fast = plant(**CASES[case])
    with_c.undo()
    with_c.setitem(sys.modules, NAME, None)
    plain = plant(**CASES[case])
    assert fast._advance is not None
    assert plain._advance is None
    found = history(fast)
    assert found == history(plain)
    assert ("surfaces" in case) == (b"[2], " in found), "two contacts at once"


def test_a_law_that_changes_in_every_step_is_left_to_python(with_c: pytest.MonkeyPatch) -> None:
    assert plant(**{"friction.law": "stribeck"})._advance is None


@pytest.mark.parametrize("is_fast", [True, False])
def test_a_count_is_any_whole_number_above_0(is_fast: bool, with_c: pytest.MonkeyPatch) -> None:
    """0 gave velocities of 0 in C, and those of the step before in Python."""
    if not is_fast:
        with_c.setitem(sys.modules, NAME, None)
    made = plant()
    assert (made._advance is not None) == is_fast
    made.step([0.1] * 4, np.int64(2))
    assert made.data.time == pytest.approx(0.001)
    before = made.strain_torque
    for count in (0, -1):
        with pytest.raises(ValueError, match=f"count is {count}; it must be 1 or more"):
            made.step([0.1] * 4, count)
    with pytest.raises(TypeError, match="float"):
        made.step([0.1] * 4, 2.0)  # type: ignore[arg-type]
    assert made.strain_torque == before


def test_an_error_of_mujoco_is_an_exception_and_the_next_step_works(with_c: pytest.MonkeyPatch) -> None:
    made = plant()
    made.brake(False)
    solver, made.model.opt.solver = made.model.opt.solver, 99
    with pytest.raises(mujoco.FatalError, match="solver"):
        made.step([0.0] * 4)
    made.model.opt.solver = solver
    made.step([0.1] * 4)
    assert not made.trouble()
    timer, before = made.data.timer, made.data.timer.duration.copy()
    mujoco.mj_step(made.model, made.data)  # the timers of others go on
    assert timer.duration[mujoco.mjtTimer.mjTIMER_STEP] > before[mujoco.mjtTimer.mjTIMER_STEP]


def test_a_failure_in_python_comes_through(with_c: pytest.MonkeyPatch) -> None:
    made = plant()
    made.brake(False)  # the levels of friction change, which Python looks up
    made._brakes = None  # type: ignore[assignment]
    made.brake(True)
    with pytest.raises(TypeError, match="NoneType"):
        made.step([0.0] * 4, 2)


def test_it_is_not_used_with_another_mujoco(built: Any, with_c: pytest.MonkeyPatch) -> None:
    with_c.setattr(built, "MUJOCO", built.MUJOCO + 1)
    assert plant()._advance is None


LIST_EXTENSIONS = """
import runpy, setuptools
setuptools.setup = lambda **given: print("extensions:", len(given["ext_modules"]))
runpy.run_path("setup.py", run_name="__main__")
"""


@pytest.mark.slow
@pytest.mark.parametrize(("wanted", "is_there", "count"), [("auto", False, 0), ("", True, 0), ("auto", True, None)])
def test_the_package_is_compiled_where_that_is_possible(
    wanted: str, is_there: bool, count: int | None, tmp_path: Path
) -> None:
    if count is None and (site := installed()):  # what is installed was compiled so
        assert len([*site.glob("wam_*/**/*.so")]) > 1
        return
    for name in ("setup.py", "setup.cfg", "pyproject.toml", "package.xml"):
        shutil.copy(SOURCE.parents[1] / name, tmp_path)
    for path in [SOURCE.parents[1] / "scripts", *SOURCE.parents[1].glob("wam_*")]:
        (tmp_path / path.name).symlink_to(path)
    path = str(Path(shutil.which(COMPILER) or "").parent) if is_there else str(tmp_path)
    environment = {**os.environ, "PATH": path, "WAM_COMPILE": wanted, "PYTHONPATH": ""}
    done = ran("-c", LIST_EXTENSIONS, check=True, cwd=tmp_path, env=environment)
    found = int(done.stdout.rpartition("extensions: ")[2])
    assert found == count if count is not None else found > 1
