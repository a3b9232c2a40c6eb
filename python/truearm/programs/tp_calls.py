"""Which statements of a FANUC listing may run something else: a program, a macro, or what is not known here.

A macro is called by its name alone ("TOOL CHANGE 2"), so that any statement that is none of those known here
may be one.
"""

import re
from typing import Final

_INDEX: Final = re.compile(r"\[[^\[\]]*\]")
_SET: Final = r"(?!\w*_PROG\b)[A-Z$][\w$.]*\s*=(?!=)"
"""An assignment, its indices left out; ERROR_PROG=.. and RESUME_PROG=.. name programs that may be run."""
_CALL: Final = re.compile(r"\b(CALL|RUN)\b", re.IGNORECASE)
_BRANCH: Final = re.compile(
    r"\s*((LBL|JMP|IF|ELSE|ENDIF|FOR|ENDFOR|SELECT)\b|=)|.*\bJMP\b", re.IGNORECASE | re.DOTALL
)
_KNOWN: Final = re.compile(
    rf"\s*(\Z|{_SET}|(LBL|JMP|ENDIF|FOR|ENDFOR)\b|ELSE\s*(,\s*JMP\b|\Z)"
    rf"|(IF\b|SELECT\b|=).*(\bTHEN\s*\Z|,\s*(JMP\b|{_SET}))"
    rf"|[JLCAS]\s*PR?\b(?!.*\b(TA|TB|DB)\b(?![^,]*,\s*{_SET}))"
    r"|(WAIT|PAUSE|END|ABORT|PAYLOAD|MESSAGE|UALM|VISION)\b|(UN)?LOCK\s+PREG\b"
    r"|(ARC\s+(START|END)|WEAVE|COL\s+(DETECT|GUARD)|TRACK|(TOUCH|MP)\s+OFFSET)\b"
    r"|(SKIP|OFFSET|TOOL_OFFSET)\s+CONDITION\b)",
    re.IGNORECASE | re.DOTALL,
)
"""Motions that call nothing, settings, branches that only jump or set, and instructions of the controller."""


def may_call(text: str) -> bool:
    """Whether a statement, without strings and remarks, may run a program or a macro."""
    bare = _INDEX.sub("", _INDEX.sub("", text))
    return _CALL.search(bare) is not None or _KNOWN.match(bare) is None


def may_leave(text: str) -> bool:
    """Whether something else than the statement before may be executed before the one behind."""
    return _BRANCH.match(text) is not None or may_call(text)
