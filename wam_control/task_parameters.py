"""Parameters of tasks."""

from dataclasses import dataclass

from wam_description.parameters import parameter


@dataclass(frozen=True)
class TaskParameters:
    """Limits of tasks."""

    condition_limit: float = parameter(
        "largest condition number of the axes of a task, each scaled to length 1", low=1.0, high=1e6, live=True,
        before=20.0,
    )  # fmt: skip
    speed_limit: float = parameter(
        "largest speed along an axis of a task", "m/s", low=0.0, high=10.0, live=True, before=0.5
    )
    joint_speed_limit: float = parameter(
        "largest speed of a joint that is an axis of a task", "rad/s", low=0.0, high=10.0, live=True, before=1.5
    )
    least_damping: float = parameter(
        "least damping of an impedance along an axis", "N s/m", low=1e-3, high=1e6, live=True, before=70.0
    )
    least_joint_damping: float = parameter(
        "least damping of an impedance of a joint", "N m s/rad", low=1e-3, high=1e6, live=True, before=5.0
    )
    largest_rate: float = parameter(
        "largest stiffness of an impedance per damping, and velocity per error of a commanded position",
        "1/s",
        low=0.0,
        high=100.0,
        live=True,
        before=8.0,
    )
    deadband: float = parameter(
        "force along an impedance below which the arm does not yield", "N", low=0.0, high=100.0, live=True, before=0.3
    )
    joint_deadband: float = parameter(
        "torque of a joint impedance below which the joint does not yield", "N m", low=0.0, high=100.0, live=True,
        before=0.1,
    )  # fmt: skip
