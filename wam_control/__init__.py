"""The joint side: force control and contact estimation, as plain classes with ``step(..., dt)``.

Modules ``*_node`` (``transform_node``, ``velocity_loop_node``, ``gravity_node``, ``force_loop_node``,
``contact_estimator_node``, ``scenario_node``) declare the nodes: inputs, outputs and steps.

================================  ==============================================================================
``transform``                     motor states to joint states, joint commands to motor commands, (A.5)
``velocity_loop``                 inner loop: PI control of each motor's velocity, torque feed-forward
``torque_loop``                   - in its place, on torque: law and node, 2.1.2
``position_loop``                 - in its place, on position: law and node, 2.1.2
``servo_reaction``                - inputs and output of both
``servo_guard``                   which gains of the velocity loop are stable on the arm
``dither``                        alternating motor torque against stiction, for contact detection at rest
``force_loop``                    outer loop: force along a direction, posture elsewhere, or joint torques
``force_command``                 - which commands are admitted: limits and age
``contact_position``              - where the force acts: estimated or configured contact position
``force_measurement``             - the external torques, by the feedback that is chosen; low pass
``pressed_pose``                  - when the arm has left what it pressed on, for the contact estimator, too
``force_axis``                    - how a force along a direction is sensed, how the arm moves along it, how well
``force_hold``                    - when the arm holds its position instead, and why
``force_case``                    - a force as it is commanded, or might be, and how well it is known
``sensing_advice``                - what to change so that a refused force would be accepted
``arm_push``                      - what pushes the arm, at least, and how fast it goes against it
``held_arm``                      - an arm that holds gives way to what presses it harder than commanded
``feed_forward``                  - torques of the forces and dry friction, fed forward
``force_swing``                   - limit cycles of the measured force, and the shaking of the arm by a dither
``motion_limits``                 - limits of the velocities: ends of the joints; gives way above the contact force
``force_law``                     - error to velocity of one axis: saturation, deadband, G_I, G_P; delay line
``given_way``                     - how far an arm has given way to what pushes it: one count per command
``posture_watch``                 - whether a posture or a position moves faster than the arm follows
``motion_watch``                  - whether a position or a velocity of a task is reached
``hybrid_velocity``               - joint velocities of force and posture together
``task``                          - a task as data: axes of force, velocity, position, impedance
``task_frame``                    - its law: strict priority, posture in what the axes leave; what 4 joints cannot do
``task_parameters``               - its limits
``torque_watch``                  - the commanded torque of a joint: reached, and known well enough
``reaction_status``               - what the loop does instead of what is commanded, in its status and back
``task_control``                  - one task after the other: refuses, holds, watches
``bumpless_transfer``             - no jump of velocity where the law changes
``guard_supervision``             - the guard's part: admits a parameter set, scales its gains
``force_loop_parameters``         - its parameters
``stability_guard``               domain, margin and largest saturation of a parameter set on the arm
``guard_watch``                   the guard while the arm moves
``guard_report``                  - its report
``sampled_loop``                  arm, velocity loop and force loop as one linear map from sample to sample
``friction_trial``                the same map with saturation and friction, for an arm of one joint
``friction_verdict``              domain, stable error and limit cycle of one friction node, chapter 5
``loop_design``                   the same for a force loop of your own
``contact_estimator``             what touches the arm: observer, detection and inference together
``momentum_observer``             - external joint torques and their covariance
``observer_parameters``           - its parameters
``velocity_fit``                  - velocities of the motors from their angles
``shaft_friction``                - nominal friction of motors and joints, and where it is uncertain
``model_errors``                  - the errors of the model, tracked in free motion
``model_prior``                   - what is known of them before: stated, or identified
``tool_load``                     - torques of a mass at the tool
``contact_inference``             - which link is touched, where and how hard
``inference_parameters``          - its parameters
``contact_fit``                   - the probability of contact positions along straight links
``contact_fusion``                - several moments of one contact that explain it together
``second_contact``                - whether a second contact has joined a steady first one
``contact_table``                 hypotheses as rows of numbers, as the topic carries them, and back
``motion``                        trajectories of the joints and straight lines, limited in speed, acceleration and jerk
``trajectory_player``             - a trajectory that a program streams
``trajectory_goal``               - how a goal of FollowJointTrajectory goes, and how it ends
``scenario``                      steps of a task, as data
``task_text``                     - the axes of a task in its file
``scenario_values``               - values of its file, refused with a reason
``scenario_settings``             - the live parameters that its steps set, checked against their declarations
================================  ==============================================================================
"""
