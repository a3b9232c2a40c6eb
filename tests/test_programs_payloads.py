"""Payloads that a program states, against the one that its corrections are for."""

from tests.programs_rig import ABB
from tests.test_programs_rapid import GO, points
from tests.test_programs_rewriting import TWO, but, program_of
from truearm.description.robot_data import Payload
from truearm.programs.notices import payload_notices


def several_loads():
    """A program under 1.5 kg, and 2 kg more."""
    part = "\n  PERS loaddata lPart:=[2,[0,0,50],[1,0,0,0],0,0,0];"
    return program_of(f"MoveJ pA,{GO}\nGripLoad lPart;\nMoveJ pB,{GO}", points() + part)


def payloads_told(program, robot, **features):
    return [notice.message for notice in payload_notices(program, robot, features)]


def test_payloads_are_compared():
    loaded, program = but(ABB, payload=Payload(0.5)), program_of(TWO)
    (text,) = payloads_told(program, loaded)
    assert "a payload of 1.5 kg, the calibration was made with 0.5 kg" in text
    assert payloads_told(program, ABB) == []


def test_payloads_are_compared_with_the_one_that_is_corrected_for():
    loaded, program = but(ABB, payload=Payload(0.5)), program_of(TWO)
    assert payloads_told(program, loaded, payload_kg=1.5, temperature=21.0) == []
    (text,) = payloads_told(program, loaded, payload_kg=4.0)
    assert "a payload of 1.5 kg, corrections are for payload_kg = 4: what" in text
    several = several_loads()
    (text,) = payloads_told(several, ABB, payload_kg=2.0)
    assert "a payload of 1.5 kg and 3.5 kg, corrections are for payload_kg = 2: what" in text
    assert text.endswith("Rewrite it once for each: --feature payload_kg=NUMBER")
    (text,) = payloads_told(several, loaded, payload_kg=1.5)
    assert "a payload of 3.5 kg, corrections" in text


def test_a_payload_in_an_unknown_unit_cannot_be_several_at_once():
    loaded = but(ABB, payload=Payload(0.5))
    assert payloads_told(program_of(TWO), loaded, payload_lb=9.0) == []
    (text,) = payloads_told(several_loads(), loaded, payload_lb=9.0)
    assert "1.5 kg and 3.5 kg, corrections are for payload_lb = 9:" in text
    assert text.endswith("--feature payload_lb=NUMBER")
