"""Plan poses, measure them with the devices of a virtual cell, and calibrate from the session."""

# %% A cell file to begin with; its devices are started as virtual ones that speak the real protocols
from pathlib import Path

import truearm as ta
from truearm.cell.accepted import accepted_table
from truearm.cell.cell_file import Cell
from truearm.cell.examples import example
from truearm.cell.measuring import Process
from truearm.cell.opening import open_session
from truearm.cell.plan import PlanOptions, plan_poses
from truearm.cell.virtual.launch import VirtualCell

text = example("rv-m2").replace("[simulate]", "[simulate]\nspeed = 500")
planned = plan_poses(ta.Robot.load("rv-m2"), PlanOptions(count=20), cell=Cell.from_toml(text))
print(len(planned.poses.readings), "poses; condition number", round(planned.choice.after["kappa"], 1))

# %% Measure them: every reading is in session.db before the next motion starts
Path("session.db").unlink(missing_ok=True)
with VirtualCell(text, processes=False) as virtual:
    cell = Cell.from_toml(virtual.cell_toml())
    with open_session(Path("session.db"), cell, planned.poses) as session:
        print(Process(cell, session, lambda progress: None).run())
        table = accepted_table(session)

# %% Calibrate from what was accepted
data = ta.Measurements.from_dataframe(table.drop(columns=["step", "purpose"]))
calibration = ta.calibrate(cell.arm, data, model="constant")
for name, errors in calibration.validation.holdout.items():
    print(f"{name}: {errors.position.mean:.3f} mm in the mean on {calibration.validation.n_holdout} poses")
