"""Parameters of the driver of a real arm; compiled with those that they add to."""

from dataclasses import dataclass

from wam_description.parameters import parameter
from wam_driver.driver import DriverParameters

SIMULATED = "simulated"


@dataclass(frozen=True)
class BusParameters(DriverParameters):
    """Parameters of the bus and of the simulated driver; of the latter a real arm uses the watchdog and the limits."""

    interface: str = parameter("of python-can, as socketcan; simulated: the plant with the controllers' bus before it")
    channel: str = parameter("of the interface, as can0; of a simulated bus the version of the controllers' firmware")
