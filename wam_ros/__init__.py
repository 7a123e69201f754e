"""ROS around the nodes of the stack: the adapter, messages, parameters, recorder and bring-up.

- node: the ROS node of a declared node (`wam_description.wiring`)
- connections: what every node of the stack has on ROS, a driver too, and the other nodes as it hears of them
- inlets: its subscriptions, from one publisher each; outlets: its publishers
- health: its status, problems, refusals and diagnostics
- tolerance: a node that goes on when a callback raises, and reports it as a fault
- ros_topics: a topic of the table on ROS: name, quality of service, header
- wire: the codec between bytes and values; messages: message objects to values and back; markers: what viewers draw
- ros_parameters: declared, described, live; remote_parameters: those of other nodes
- requests: requests to services and their answers; client: a running stack as a program next to it sees it
- recorder, recorder_node, recorder_interface: every topic of one run into a bag
- bring_up: all nodes, in processes or in this one; run: context, executor and signals; priority: of a process
- long_steps: a node that holds up the others of its process
- processors: one for the inner loop in lockstep
- process_signals: signals from the imports of a program to its end
- conformance: a running driver tested against its contract; driver_bench: the node that does it
- testing: the test kit; pytest_plugin: its fixtures
- limits: waits, counts and lengths of all these
- network: limits ROS to this machine; one node of a name in each place
"""
