"""Time of a substep of the plant relative to a bare mj_step of the same model in the same state."""

import time
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import comparing.source_tree  # noqa: F401 - before the packages
import mujoco
import numpy as np
from comparing import Quartiles, arguments, machine, mark, quartiles, ratios, save, table

from wam_control.task.scenario import load
from wam_description.configuration import Configuration, packaged
from wam_description.mjcf import mjcf
from wam_description.rigid_body import RigidBody
from wam_description.transmission_map import TransmissionMap
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
SUBSTEP = Configuration.load(packaged("wam")).shared.timing.substep
FREE = (0.0, -0.6, 0.0, 0.5)  # rad
PUSH = (np.array([0.0, 12.0, 0.0]), np.array([0.0, 0.0, 12.0 * 0.28]))  # N, N m


class Case:
    """The plant and its bare MuJoCo model in one state.

    Parameters
    ----------
    q : pose at the start, rad.
    extra : torque of each motor in addition to gravity compensation, N m.
    pushed : whether a disturbance pushes on the last link.
    name : of the configuration.
    values : overrides of it.
    """

    def __init__(
        self,
        q: tuple[float, ...],
        extra: float,
        pushed: bool = False,
        name: str = "wam",
        values: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        configuration = Configuration.load(packaged(name)).with_values({"arm.joints.start": q, **values})
        arm, step = configuration.shared.arm, configuration.shared.timing.substep
        parameters = configuration.node("driver", DriverParameters)
        self._together = configuration.shared.timing.substeps
        self.plant = Plant(arm, parameters.world, parameters.effects, step)
        self.bare = mujoco.MjModel.from_xml_string(mjcf(arm, step, parameters.world, parameters.effects))
        self.data = mujoco.MjData(self.bare)
        gravity = RigidBody(arm).gravity_torque(q).tolist()
        self.torque = [tau + extra for tau in TransmissionMap.of(arm).motor_torques(gravity)]
        self.plant.brake(False)
        if pushed:
            self.plant.push(arm.covers.names[-1], *PUSH)
        self._steps(20)
        self._state = np.empty(mujoco.mj_stateSize(self.bare, STATE))
        mujoco.mj_getState(self.plant.model, self.plant.data, self._state, STATE)

    def _steps(self, count: int) -> None:
        for _ in range(count // self._together):  # as the driver does
            self.plant.step(self.torque, self._together)

    def _bare_steps(self, count: int) -> None:
        for _ in range(count):
            mujoco.mj_step(self.bare, self.data)

    def measure(self, count: int) -> tuple[float, float]:
        """Seconds a step, of the plant and of the bare model, from the same state."""
        mujoco.mj_setState(self.plant.model, self.plant.data, self._state, STATE)
        self.bare.dof_frictionloss[:] = self.plant.model.dof_frictionloss
        mujoco.mj_setState(self.bare, self.data, self._state, STATE)
        return _seconds(self._steps, count), _seconds(self._bare_steps, count)


def _seconds(steps: Callable[[int], None], count: int) -> float:
    begin = time.perf_counter()
    steps(count)
    return (time.perf_counter() - begin) / count


def every_effect(motors: int) -> dict[str, Any]:
    """Everything that the plant can do at once, in addition to what is always on."""
    return {
        "driver:effects.tension_friction": (1e-5,) * motors,
        "driver:effects.added_coulomb_friction": (0.1,) * motors,
        "driver:effects.ripples.amplitude": (0.01,) * motors,
    }


def pose_in_contact() -> tuple[float, ...]:
    """Where the outer link just touches the box on the demonstration's way down, rad."""
    steps = load(packaged("demo_scenario"), Configuration.load(packaged("wam")).shared)
    i = next(i for i, step in enumerate(steps) if step.until_force > 0.0)
    above, below = np.array(steps[i - 1].posture), np.array(steps[i].posture)
    for share in np.linspace(0.0, 1.0, 51):
        pose = tuple((above + share * (below - above)).tolist())
        if Case(pose, 0.0).plant.data.ncon:
            return pose
    raise SystemExit("the demonstration's way down does not touch the box; look at config/demo_scenario.yaml")


LIMITS = {
    "arm free, moving": (1.38, 1.3),
    "arm free, pushed": (1.75, 1.3),
    "in contact": (1.5, 1.3),
    "testbed, moving": (1.5, 1.3),
}  # of the ratio: must, aim


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=200, quick_rounds=5)
    count = 40  # steps; short, so that the state stays what it is
    cases = {
        "arm free, moving": Case(FREE, extra=0.2),
        "arm free, pushed": Case(FREE, extra=0.2, pushed=True),
        "arm, every effect on": Case(FREE, extra=0.2, values=every_effect(4)),
        "in contact": Case(pose_in_contact(), extra=0.0),
        "testbed, moving": Case((0.1,), extra=0.2, name="testbed"),
    }
    seconds: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in cases}
    for _ in range(given.rounds):
        for name, case in cases.items():
            for kept, one in zip(seconds[name], case.measure(count), strict=True):
                kept.append(one)
    rows, measured = [], dict[str, Any]()
    for name, (plant, bare) in seconds.items():
        ratio = ratios(plant, bare)
        micro = [Quartiles(*(1e6 * value for value in quartiles(part))) for part in (plant, bare)]
        best = min(plant) / min(bare)
        contacts = cases[name].plant.data.ncon
        times = f"{SUBSTEP / min(plant):.0f}"
        middle = [f"{part.median:.1f}" for part in micro]
        reached = mark(ratio.median, *LIMITS[name]) if name in LIMITS else ""
        rows.append([name, str(contacts), *middle, f"{ratio:.2f}", f"{best:.2f}", times, reached])
        measured[name] = {"ratio": ratio, "best": best, "plant_us": micro[0], "bare_us": micro[1]}
    print(machine())
    head = [
        "substep",
        "contacts",
        "plant [us]",
        "mj_step [us]",
        "ratio (middle half)",
        "of the best",
        "times real time",
        "[must, aim]",
    ]
    print(table(head, rows))
    save("plant", given, measured)


if __name__ == "__main__":
    main()
