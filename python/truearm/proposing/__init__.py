"""Poses to measure next, given a calibration: those that teach it most, and those that check it best."""

from truearm.proposing.acceptance import Acceptance, acceptance_poses
from truearm.proposing.after_update import expected_by_update
from truearm.proposing.candidates import Candidates
from truearm.proposing.next_poses import NextPoses, next_poses

__all__ = ["Acceptance", "Candidates", "NextPoses", "acceptance_poses", "expected_by_update", "next_poses"]
