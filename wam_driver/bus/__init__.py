"""The driver of a production WAM on its CAN bus, and a simulator of that bus.

- frames: requests, packed torques and replies as bytes
- properties: numbers of the controllers' properties by firmware
- safety_module: its modes, and what the pendant shows
- bus_fault: what is wrong, as data
- line: python-can and a clock, or the simulated bus; the simulated arm on a bus of python-can
- host: the computer's end of the line, with questions and answers
- start_up: finds, wakes, checks and zeroes the controllers
- motor, cycle: what is sent and taken in each period
- arm_bus: the driver, one call per period
- bus_parameters, interface, bus_driver_node: the node, also for a bus of your own
- dry_run: what is on the bus, and what would be sent
- simulator: controllers, safety module and a person, in bus time
"""
