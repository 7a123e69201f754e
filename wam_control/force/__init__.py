"""The outer loop: forces, tasks, and the guard of its stability.

=========================  ================================================================================
``arm_push``               what pushes the arm, at least, and how fast it goes against it
``contact_position``       where the force acts: estimated or configured position; a commanded force in its pose
``feed_forward``           torques of the forces and dry friction, fed forward
``force_axis``             how a force along a direction is sensed, how the arm moves along it, how well
``force_command``          which commands are admitted: limits and age
``force_hold``             when the arm holds its position instead, and why
``force_law``              error to velocity of one axis: saturation, deadband, G_I, G_P; delay; bumpless transfer
``force_loop``             outer loop: force along a direction, posture elsewhere, or joint torques
``force_loop_node``        the node
``force_loop_parameters``  its parameters
``force_measurement``      the external torques, by the feedback that is chosen; low pass
``force_swing``            limit cycles of the measured force, and the shaking of the arm by a dither
``friction_trial``         the same map with saturation and friction, for an arm of one joint
``friction_verdict``       domain, stable error and limit cycle of one friction node, chapter 5
``given_way``              how far an arm has given way to what pushes it; whether it has left what it pressed on
``guard``                  admits a parameter set, scales its gains while the arm moves, reports
``held_arm``               an arm that holds gives way to what presses it harder than commanded
``hybrid_velocity``        joint velocities of force and posture together
``loop_design``            the same for a force loop of your own
``motion_limits``          limits of the velocities: ends of the joints; gives way above the contact force
``motion_watch``           whether a position or a velocity of a task is reached
``posture_watch``          whether a posture or a position moves faster than the arm follows
``sampled_loop``           arm, velocity loop and force loop as one linear map from sample to sample
``sensing_advice``         what to change so that a refused force would be accepted
``stability_guard``        domain, margin and largest saturation of a parameter set on the arm
``task``                   a task as data: axes of force, velocity, position, impedance; its limits
``task_control``           one task after the other: refuses, holds, watches
``task_frame``             its law: strict priority, posture in what the axes leave; what 4 joints cannot do
``thresholds``             what no parameter sets: when a force is reached, kept, lost; what the guard takes as stable
``torque_watch``           the commanded torque of a joint: reached, and known well enough
=========================  ================================================================================
"""
