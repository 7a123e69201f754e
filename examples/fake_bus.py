"""A motor bus that is none: what `bus_driver.py` needs of yours."""


class FakeBus:
    """Motors with inertia and damping; replace it by yours, with the same method and attributes.

    Attributes
    ----------
    position, velocity, current : of the motors, rad, rad/s, A, as measured.
    """

    INERTIA, DAMPING = 2e-3, 0.02  # kg m^2, N m s/rad

    def __init__(self, torque_constant: tuple[float, ...]) -> None:
        self._torque_constant = torque_constant
        self.position, self.velocity, self.current = ([0.0] * len(torque_constant) for _ in range(3))

    def write(self, currents: list[float], brakes_on: bool, dt: float) -> None:
        """Send currents, A, and the state of the brakes; here they also move the motors."""
        self.current = list(currents)
        for i, (current, constant) in enumerate(zip(currents, self._torque_constant, strict=True)):
            torque = current * constant - self.DAMPING * self.velocity[i]
            self.velocity[i] = 0.0 if brakes_on else self.velocity[i] + torque / self.INERTIA * dt
            self.position[i] += self.velocity[i] * dt
