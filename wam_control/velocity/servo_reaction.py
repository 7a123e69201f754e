"""Inputs and output of every node that closes the inner loop on the position or velocity of the motors."""

from typing import Final

from wam_description.wiring import Input, reaction

SERVO_REACTION: Final = reaction(
    Input("motor_states"),
    Input("motor_velocity_command", "velocity?", delayed=True, absent="brake"),
    Input("motor_effort_command", "effort", delayed=True, absent="brake"),
    outputs=("motor_current_command",),
)
