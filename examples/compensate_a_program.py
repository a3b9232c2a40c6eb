"""Rewrite a program for a calibrated arm, and see against the truth of a virtual one what that gains."""

# %% A virtual ABB IRB 120, measured with the orientation of its tool
from pathlib import Path

import numpy as np
from scipy.spatial.distance import pdist

import truearm as ta
from truearm.simulation import VirtualArm

arm = VirtualArm(ta.Robot.load("abb-irb-120"), seed=3)
calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(80, seed=1), orientation=True), model="constant")

# %% A program with joint and Cartesian targets, and one motion that nobody can be certain of
PROGRAM = """MODULE Pick
  PERS tooldata tGrip:=[TRUE,[[0,0,120],[1,0,0,0]],[1.5,[0,0,50],[1,0,0,0],0,0,0]];
  CONST robtarget pPart:=[[420.0,30.0,240.0],[0.0,0.0,1.0,0.0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pNext:=[[420.0,-90.0,240.0],[0.0,0.0,1.0,0.0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST jointtarget jHome:=[[0,0,20,0,40,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveAbsJ jHome,v500,fine,tGrip;
    MoveL pPart,v50,fine,tGrip;
    MoveL pNext,v50,fine,tGrip;
    MoveL Offs(pHidden,0,0,10),v50,fine,tGrip;
  ENDPROC
ENDMODULE
"""
Path("pick.mod").write_text(PROGRAM, encoding="utf-8")

# %% Rewritten for a controller that computes with the catalogue's dimensions
rewritten = ta.compensate_program("pick.mod", ta.Compensator(calibration), controller="nominal")
Path("compensated").mkdir(exist_ok=True)
print("written:", *rewritten.save("compensated"))
print("moved by", rewritten.correction_mm.round(3), "mm")
for listed in rewritten.listed:
    print("left as it is:", listed.reason)

# %% How far apart the real tool's places are with each program, and how far the author meant them to be.
# Distances do not depend on where the base stands, which no calibration of an arm can know.
meant = pdist(arm.robot.position(rewritten.nominal))
for name, q in (("as it was", rewritten.nominal), ("rewritten", rewritten.corrected)):
    print(
        f"{name}: distances off by {1e3 * np.abs(pdist(arm.true_position(q)) - meant).max():.3f} mm at most"
    )
