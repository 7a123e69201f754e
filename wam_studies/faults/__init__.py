"""The evaluation of faults (`wam evaluate faults`).

trials             what a trial is, the limits of motion, force and delay, and the results by kind
message_faults     messages broken field by field, stamp by stamp, byte by byte
parameter_faults   sets of live parameters, in part good and in part not
bag_faults         bags broken at random, and what a reader makes of them
page               the table of results and docs/safety.md
kinds              the table of kinds
messages, parameter_sets, second_publishers, disks, bags   trials on the nodes in this process
losses             trials on nodes in processes of their own
interruptions      Ctrl-C at random moments of the demonstration
soak               a long run, its memory and its losses
watched_stack, node_processes   the nodes and what is measured on them
answered_clock     realtime that does not depend on the speed of the machine
"""
