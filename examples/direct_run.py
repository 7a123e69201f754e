"""Play the demonstration without ROS and say how well the force was held."""

from wam_analysis.direct import DirectRun
from wam_control.scenario import load
from wam_description.configuration import Configuration, packaged

configuration = Configuration.load(packaged("wam")).with_values({"force_loop:force_gain": [0.01]})
run = DirectRun(configuration, load(packaged("demo_scenario"), configuration.shared.arm))
if failure := run.play():
    raise SystemExit(failure)
for asked, measured in list(zip(run.rows["force_command"], run.rows["force_measured"], strict=True))[::200]:
    if any(asked.values):  # y of the outer link: the arm presses down
        print(f"{asked.stamp / 1e9:6.2f} s  asked {asked.values[1]:6.2f} N  measured {measured.values[1]:6.2f} N")
