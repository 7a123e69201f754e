"""The evaluation of faults (`wam evaluate faults`), without ROS; `wam_trials.faults` plays the trials on the nodes.

trials             what a trial is, the limits of motion, force and delay, and the results by kind
message_faults     messages broken field by field, stamp by stamp, byte by byte
parameter_faults   sets of live parameters, in part good and in part not
bag_faults         bags broken at random, and what a reader makes of them
page               the table of results and docs/reliability.md
"""
