"""The analysis of any recording, as `wam analyse` prints it.

analysis               reads a bag and makes all sections, of one list
finding                one number with its prediction; a section
held_force             each commanded force: measures and predictions
steps                  section about the steps of a scenario, in answers
topics                 section about the topics of another robot, and what was done to their values
force_steps            section about steps of a commanded force of another robot
following              section about gain, delay, play and steady error of what is commanded to another robot
repetition             sections about cycles and lines in a spectrum, of another robot
effort                 section about friction and inertia of another robot
stick_slip             section about rest and motion of motors and joints
force                  sections about force and stability
contact                section about contacts, estimated and true
prediction             the friction node at the contact, what chapter 5 and the stability guard predict for it
transmission           motors, cables and joints on one time base, and their friction
friction               section about friction
efficiency             section about efficiency
timing                 section about the loop, and provenance
tabulated              tables of subjects and quantities
charts, plots          the charts, as numbers, and the picture of the arm
text, page             the analysis as text and JSON, and as HTML
"""
