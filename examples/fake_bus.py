"""A simulated motor bus: `bus_driver.py` needs a bus with the methods and attributes of this class."""

from collections import Counter
from collections.abc import Sequence

from wam_description.signals import State


class FakeBus:
    """Motors with inertia and damping; replace it by your bus.

    Attributes
    ----------
    position, velocity, current : of the motors, rad, rad/s, A, as measured.
    is_running : whether these are known; until then `exchange` starts the motors.
    advice : what a person has to do before the motors may be released, '' if nothing.
    trouble : the event because of which the motors were braked; None if they were not.
    counts : numbers of errors that are not a fault, for the diagnostics.
    """

    INERTIA, DAMPING = 2e-3, 0.02  # kg m^2, N m s/rad
    is_running, advice, trouble = True, "", None

    def __init__(self, torque_constant: tuple[float, ...], peak: list[float], period: float) -> None:
        self._torque_constant, self._peak, self._period = torque_constant, peak, period
        self.position, self.velocity, self.current = ([0.0] * len(torque_constant) for _ in range(3))
        self._is_released = False
        self.counts = Counter[str]()

    @property
    def state(self) -> State:
        """Position, velocity and current."""
        return State(self.position, self.velocity, self.current)

    def exchange(self, periods: int) -> None:
        """Take the state of the motors; here they also move, by some periods."""
        dt = periods * self._period
        for i, (current, constant) in enumerate(zip(self.current, self._torque_constant, strict=True)):
            torque = current * constant - self.DAMPING * self.velocity[i]
            self.velocity[i] = self.velocity[i] + torque / self.INERTIA * dt if self._is_released else 0.0
            self.position[i] += self.velocity[i] * dt

    def command(self, currents: Sequence[float]) -> None:
        """Send currents, A, clipped."""
        if self._is_released:
            self.current = [min(max(i, -most), most) for i, most in zip(currents, self._peak, strict=True)]

    def brake(self, on: bool) -> None:
        """Put on the brakes, without a current, or release them."""
        self._is_released = not on
        self.current = [0.0] * len(self.position)

    def stop(self) -> None:
        """Stop as safely as the motors can."""
        self.brake(True)

    def clear(self) -> None:
        """Forget a fault."""

    close = clear

    def confirm_home(self) -> bool:
        """These motors know their angles."""
        return False
