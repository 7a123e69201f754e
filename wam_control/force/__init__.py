"""The outer loop: forces, tasks, and the guard of its stability.

=========================  ================================================================================
``advice``                 what to change so that a refused force would be obeyed
``axes``                   what is commanded, as the axes of one problem
``belief``                 what is known of a force; its predicted error and doubt
``command_run``            the state of one command
``contact_place``          where a force acts: pinned or estimated
``force_axis``             how a force along a direction is sensed, how the arm moves along it, how well
``force_command``          which commands are admitted: limits and age
``force_input``            what the loop is given in one outer period
``force_law``              error to velocity of one axis: saturation, deadband, G_I, G_P
``force_loop``             one outer period
``force_loop_node``        the node
``force_loop_parameters``  its parameters
``force_measurement``      the external torques, by the feedback that is chosen; low pass
``force_watch``            the six events, each by a condition that lasts
``guard``                  admits a parameter set, scales its gains while the arm moves, reports
``held_arm``               an arm that is pushed
``knowledge``              what is known of each force of a command in a period
``limits``                 what bounds the motion
``problem``                joint velocities of one period: least squares with limits
``sampled_loop``           arm, velocity loop and force loop as one linear map from sample to sample
``stability_guard``        domain, margin and largest saturation of a parameter set on the arm
``task``                   a task as data: axes of force, velocity, position, impedance; its limits
``thresholds``             what no parameter sets
=========================  ================================================================================
"""
