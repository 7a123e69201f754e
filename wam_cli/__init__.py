"""The command `wam`.

- main: the command line and the table of commands; program: handles Ctrl-C before main is imported
- commands: one module per command, and the options that several commands share
"""
