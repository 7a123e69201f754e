"""A driver of your own: the stack's node for a real arm around a motor bus, here `fake_bus.py`.

PYTHONPATH=. wam conform --config bus_driver.yaml
PYTHONPATH=. wam up --config bus_driver.yaml
"""

from typing import Any

from fake_bus import FakeBus

from wam_description.arm import Shared
from wam_driver.bus.bus_driver_node import BusDriver


class OwnInterface:
    """What the stack knows of this driver: like the simulated one, without the topics of the simulation."""

    name, parameters = "driver", "wam_driver.driver:DriverParameters"
    ros_node = "bus_driver:OwnDriver"
    sources = ("motor_states", "motor_currents", "robot_description", "/clock")
    listens = ("motor_current_command",)


class OwnDriver(BusDriver):
    """The node with another bus."""

    entry = "bus_driver:OwnInterface"

    def make_hardware(self, shared: Shared, own: Any) -> FakeBus:
        """The motors."""
        motors = shared.arm.motors
        peak = [torque / k for torque, k in zip(motors.peak_torque, motors.torque_constant, strict=True)]
        return FakeBus(motors.torque_constant, peak, shared.timing.period)
