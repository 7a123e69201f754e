"""The motor side: the simulated arm and its driver.

- driver: the driver without ROS: commands, watchdog, limits, states; its parameters
- interface: what every driver of the arm takes and gives
- arm_driver_node: what every node `driver` has, simulated or real; driver_node: the simulated one
- lockstep, realtime: the two ways in which its time passes
- pacer: simulated time no faster than the wall clock
- session: which start of the driver the nodes follow
- safety: braked, enabled, fault
- limit_watch: speeds, travel, currents and tensions against their limits
- amplifier: clipping, I2t, deadband, ripple and noise of the motor currents
- sensors: resolution and noise of encoders and strain gauges
- imperfections: parameters of amplifiers and sensors
- plant: the arm in MuJoCo, stepped with motor torques; its steps in C, where the package is built with WAM_COMPILE
- step_size: which step fits the plant's stiffest mode
- friction: laws of dry friction and their parameters
- dry_friction: dry friction of all motors and joints, by these laws
- circuits: creep, slack, torque and tension of the cable circuits
- surfaces: contact forces of all that a cover can touch
- objects: moving obstacles; true pose, motion and contact forces of bodies and doors
- loads: pushes, and the load on each cover
- bus: the driver of a real WAM on its CAN bus, and a simulator of that bus
- thresholds: what counts as stuck, touching and stable; when the driver warns and waits
- pusher: hands that follow a moving link and press on it
"""
