"""What the driver of a real arm takes and gives."""


class BusInterface:
    """Node `driver`: a production WAM on its CAN bus, without the topics of a simulation."""

    name, parameters = "driver", "wam_driver.bus.bus_parameters:BusParameters"
    ros_node = "wam_driver.bus.bus_driver_node:BusDriver"
    sources = ("motor_states", "motor_currents", "robot_description", "/clock")
    listens = ("motor_current_command",)
