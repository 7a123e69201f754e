"""ROS around the nodes of the stack: the adapter, messages, parameters, recorder and bring-up.

- node: the ROS node of a declared node (`wam_description.wiring`); the program that starts one
- ports: subscriptions, status and diagnostics of a node
- topics: a topic of the table on ROS: name, quality of service, header
- local_bus: messages between nodes of one process, without the middleware
- outlets: what a node publishes; copies of it for a viewer, few a second
- refusals: messages that a node refuses; claims of one publisher for each topic that it works on
- messages: ROS messages to values and back; markers: what viewers draw
- wire: the same from and to bytes, faster, for the types that carry numbers
- tolerance: a node that goes on when a callback raises, and reports it as a fault
- parameters: declared, described, live; remote_parameters: those of other nodes
- recorder, recorder_node, recorder_interface: every topic into a bag
- bring_up: all nodes, in processes or in this one; run: context, executor and signals; priority: of a process
- long_steps: a node that holds up the others of its process
- processors: those that the processes of one lockstep keep to
- process_signals: signals from the imports of a program to its end; program: that of a node
- requests: requests to services and their answers; call: one request from a shell
- conformance: a running driver tested against its contract; driver_probe: the node that does it
- driver_bench: states and currents of that driver; message_checks, stop_checks: a function for each row
- testing: the test kit; pytest_plugin: its fixtures
- limits: waits, counts and lengths of all these
- network: limits ROS to this machine; one node of a name in each place
"""
