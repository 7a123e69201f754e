"""Motion over time: trajectories, and scenarios of steps.

=====================  ================================================================================
``motion``             trajectories of the joints and straight lines, limited in speed, acceleration and jerk
``scenario``           steps of a task, as data
``scenario_node``      the node
``scenario_settings``  the live parameters that its steps set, checked against their declarations
``scenario_values``    values of its file, refused with a reason
``task_text``          the axes of a task in its file
``trajectory_goal``    how a goal of FollowJointTrajectory goes; a trajectory that a program streams
=====================  ================================================================================
"""
