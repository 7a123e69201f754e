"""The studies of faults (`wam evaluate faults`) and of a long run (`wam evaluate soak`).

study              every kind of fault, its trials in the harness
trials             what a trial is, the limits of motion, force and delay, the nodes that trials share
message_faults     messages broken field by field, stamp by stamp, byte by byte
messages, parameter_sets   trials on the nodes in one process
losses             nodes in processes of their own, and trials on them
soak               a long run, its memory and its losses
watched_stack      the nodes in one process and what is measured on them
answered_clock     realtime that does not depend on the speed of the machine
"""
