"""What the driver of a real arm takes and gives, and its parameters."""

from dataclasses import dataclass

from wam_description.parameters import parameter
from wam_driver.driver import DriverParameters

SIMULATED = "simulated"


@dataclass(frozen=True)
class BusParameters(DriverParameters):
    """Parameters of the bus and of the simulated driver; of the latter a real arm uses the watchdog."""

    interface: str = parameter("of python-can, as socketcan; simulated: the plant with the controllers' bus before it")
    channel: str = parameter("of the interface, as can0; of a simulated bus the version of the controllers' firmware")


class BusInterface:
    """Node `driver`: a production WAM on its CAN bus, without the topics of a simulation."""

    name, parameters = "driver", "wam_driver.bus.interface:BusParameters"
    ros_node = "wam_driver.bus.bus_driver_node:BusDriver"
    sources = ("motor_states", "motor_currents", "robot_description", "/clock")
    listens = ("motor_current_command",)
