"""Trials on the running nodes; what is tried, and what comes out of it, is in `wam_experiments`, which knows no ROS.

- experiment_runs: the runs of an experiment, recorded
- contact_scenarios: scenarios of the contact benchmark over topics
- faults: broken messages, lost nodes, full disks, Ctrl-C, and a long run, on nodes that are watched
"""
