"""Play the demonstration without ROS and print how well the force was held."""

from wam_control.task.scenario import load
from wam_description.configuration import Configuration, packaged
from wam_sim.simulation import Simulation

configuration = Configuration.load(packaged("wam")).with_values({"force_loop:force_gain": [0.01]})
run = Simulation(configuration, load(packaged("demo_scenario"), configuration.shared))
if failure := run.play() or run.unmet:  # the run failed, or a command was not carried out
    raise SystemExit(failure)
for command, force in list(zip(run.rows["force_command"], run.rows["force_measured"], strict=True))[::200]:
    if any(command.values):  # y of the outer link: the arm presses down
        print(f"{command.stamp / 1e9:6.2f} s  commanded {command.values[1]:6.2f} N  measured {force.values[1]:6.2f} N")
