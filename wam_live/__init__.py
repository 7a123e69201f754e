"""The live page: the arm, its contacts and its forces in a browser, from a running stack or from a bag.

- snapshot: what the page shows at one instant
- scene: the three-dimensional picture: links, surroundings and objects, contact arrows, dragging a link
- panel: status, buttons, sliders and plots
- page: the web server that holds both, reachable from this machine alone
- stack_source: a running stack as the source
- live_page: the page of a running stack, and what it asks of the stack
- scenario_player: a scenario or task played into a running stack
- services: what a person asks of a stack by one word
- hold: a topic that is published while somebody drags or presses
- playback: a bag as the source
- thresholds: times and sizes

Other programs next to a running stack:

- push: a push as by hand, of `wam call push`
- trajectory_action: the action FollowJointTrajectory
"""
