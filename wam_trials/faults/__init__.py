"""Trials of faults on the nodes (`wam evaluate faults`); what is broken and how is in `wam_experiments.faults`.

- kinds: the table of kinds
- messages, parameter_sets, second_publishers, disks, bags: trials on the nodes in this process
- losses: trials on nodes in processes of their own
- interruptions: Ctrl-C at random moments of the demonstration
- soak: a long run, its memory and its losses
- watched_stack, node_processes: the nodes and what is measured on them
- answered_clock: realtime that does not depend on the speed of the machine
"""
