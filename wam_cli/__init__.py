"""The command `wam`.

- main: the command line and the table of commands; program: handles Ctrl-C before main is imported
- commands: one module per command, and the options that several commands share
- trajectory_action: the action FollowJointTrajectory of `wam follow`, a client of the stack as others are
- frame_publisher: /tf and /tf_static of `wam tf`; stack_client: what both need of a running stack
- faults: trials of faults on the nodes, for `wam evaluate faults`
"""
