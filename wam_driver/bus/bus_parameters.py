"""Parameters of the driver of a real arm; compiled with those that they add to."""

from dataclasses import dataclass

from wam_description.arm import Arm
from wam_description.parameters import parameter, require
from wam_driver.driver import DriverParameters

SIMULATED = "simulated"


@dataclass(frozen=True)
class BusParameters(DriverParameters):
    """Parameters of the bus and of the simulated driver; of the latter a real arm uses the watchdog and the limits."""

    interface: str = parameter("of python-can, as socketcan; simulated: the plant with the controllers' bus before it")
    channel: str = parameter("of the interface, as can0; of a simulated bus the version of the controllers' firmware")
    home: tuple[float, ...] = parameter(
        "joint angles of the home pose, at which `confirm_home` sets the zero", "rad", within=13.0
    )

    def require_fit(self, arm: Arm) -> None:
        """Refuse a home pose that has not one angle for each joint, or one beyond its stops."""
        n = arm.n
        require(len(self.home) == n, f"parameter 'home' has {len(self.home)} values; {n} joints need {n}")
        require(not (beyond := arm.joints.beyond(self.home)), f"parameter 'home': {beyond}")
