"""From recordings to measures, findings, reports and pictures; nothing here runs the arm.

recording           what the sections of an analysis take from a bag
recorded            the arm and its controllers, built from the parameters in a bag
measures            step responses, limit cycles, friction ...: functions of arrays
findings            the analysis behind `wam analyse`: sections of sentences and numbers, as text, HTML and JSON
foreign             recordings of other robots: any bag with joints, wrenches or mapped topics
identification      from a recording of free motion to the controllers' model, behind `wam identify`
traces              forces and contacts of a run on one time base
held_messages       for how long a recorded message is held, and the gaps of a topic
holds               the constant forces that were commanded in a run, by themselves or in tasks
contact_list        the contacts one by one, each estimated one compared with the true one
unplanned_contact   contacts while no force is commanded that are harder than allowed
drawing             colours and sizes that all pictures share
arm_picture         the arm and its obstacles from the side
table               tables of text, for a terminal and for Markdown
thresholds          what is evaluated, and when it is certain, by concern; the layout of reports
"""
