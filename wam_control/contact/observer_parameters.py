"""Parameters of the momentum observer: the model's deviations from the configured arm, and its uncertainty."""

from dataclasses import dataclass

from wam_description.arm import Arm
from wam_description.parameters import lengths, parameter, require


@dataclass(frozen=True)
class ObserverParameters:
    """Nominal model of the observer, and how uncertain that model is."""

    time_constant: float = parameter("time in which the estimate reaches 63 % of a step", "s", low=1e-3, high=1.0)
    detection_time: float = parameter(
        "the same for a second, faster estimate, which detects contacts from the motors; 0: none",
        "s",
        high=1.0,
    )
    mass_scale: tuple[float, ...] = parameter(
        "factor on mass and inertia of each link in the estimator's model; 1: no deliberate error", low=0.1, high=10.0
    )
    friction_scale: float = parameter("the same for friction", high=10.0)
    mass_uncertainty: float = parameter(
        "sd of the error of the modelled torques of gravity and of inertia, as a fraction of them", high=1.0
    )
    centre_uncertainty: float = parameter("sd of each coordinate of the centre of mass of each link", "m", high=1.0)
    moving_uncertainty: float = parameter(
        "sd of the error of the friction of a moving shaft before it is tracked, as a fraction of the friction",
        high=10.0,
    )
    asymmetry_uncertainty: float = parameter(
        "sd of the difference between the friction in one direction and the mean, as a fraction of the friction",
        high=10.0,
    )
    load_uncertainty: float = parameter(
        "sd of the friction per transmitted torque, of a motor and of a joint that several motors drive",
        high=1.0,
    )
    torque_scale_uncertainty: float = parameter("sd of a motor's torque constant, as a fraction", high=1.0)
    torque_delay_uncertainty: float = parameter(
        "sd of the delay of the motor torques with respect to the motor angles; one delay for all motors",
        "s",
        high=0.1,
    )
    shape_uncertainty: float = parameter(
        "sd of the friction of a slow shaft, as a fraction of static friction",
        high=10.0,
    )
    payload_uncertainty: float = parameter(
        "without joint sensors and with payload 0: sd of the mass at the tool", "kg", high=50.0
    )
    drift: float = parameter("random drift of these model errors in one second, as a fraction of their sd", high=10.0)
    rest_uncertainty: float = parameter(
        "sd of the friction of a shaft at rest, as a fraction of static friction", high=10.0
    )
    motor_rest_velocity: float = parameter(
        "motor speed from which Coulomb friction has its full size", "rad/s", low=1e-6, high=100.0
    )
    joint_rest_velocity: float = parameter("the same for a joint", "rad/s", low=1e-6, high=100.0)
    friction_memory: float = parameter(
        "time constant with which the friction of a shaft becomes unknown after the shaft stops",
        "s",
        low=1e-4,
        high=1.0,
    )
    motor_torque_sd: float = parameter("sd of the motor torques", "N m", low=1e-6, high=100.0)
    motor_torque_fraction: float = parameter("further sd of the motor torques, as a fraction of the torque", high=1.0)
    motor_noise: float = parameter(
        "initial sd of the torque of a moving motor, as a fraction of dynamic friction; then it is tracked",
        high=10.0,
    )
    joint_torque_sd: float = parameter("sd of the joints' strain gauges", "N m", low=1e-6, high=100.0)
    payload: tuple[float, ...] = parameter("smallest and largest mass that the tool may carry", "kg", high=50.0)

    def __post_init__(self) -> None:
        low, high = self.payload if len(self.payload) == 2 else (1.0, 0.0)
        require(
            low <= high,
            f"parameter 'observer.payload' is {list(self.payload)}; it needs the smallest and the largest mass",
        )

    def require_fit(self, arm: Arm) -> None:
        """Refuse factors that are not one for each link."""
        lengths("observer", arm.links.names, {"mass_scale": self.mass_scale})
