"""The command `wam`.

- main: the command line and the table of commands
- commands: one module per command, and the options that several commands share
- faults: trials of faults on the nodes, for `wam evaluate faults`
"""
