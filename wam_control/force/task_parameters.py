"""Parameters of tasks."""

from dataclasses import dataclass

from wam_description.parameters import tunable


@dataclass(frozen=True)
class TaskParameters:
    """Limits of tasks."""

    condition_limit: float = tunable(
        "largest condition number of the axes of a task, each scaled to length 1", low=1.0, high=1e6, before=20.0
    )
    speed_limit: float = tunable("largest speed along an axis of a task", "m/s", high=10.0, before=0.5)
    joint_speed_limit: float = tunable(
        "largest speed of a joint that is an axis of a task", "rad/s", high=10.0, before=1.5
    )
    least_damping: float = tunable(
        "least damping of an impedance along an axis", "N s/m", low=1e-3, high=1e6, before=70.0
    )
    least_joint_damping: float = tunable(
        "least damping of an impedance of a joint", "N m s/rad", low=1e-3, high=1e6, before=5.0
    )
    largest_rate: float = tunable(
        "largest stiffness of an impedance per damping, and velocity per error of a commanded position",
        "1/s",
        high=100.0,
        before=8.0,
    )
    deadband: float = tunable(
        "force along an impedance below which the arm does not yield", "N", high=100.0, before=0.3
    )
    joint_deadband: float = tunable(
        "torque of a joint impedance below which the joint does not yield", "N m", high=100.0, before=0.1
    )

    def fastest(self, is_joint: bool) -> tuple[float, str]:
        """Largest speed along an axis, m/s, or of a joint, rad/s, and the name of that parameter."""
        if is_joint:
            return self.joint_speed_limit, "task.joint_speed_limit"
        return self.speed_limit, "task.speed_limit"
