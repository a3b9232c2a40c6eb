"""RAPID's functions: those of the controller, and those of a module that do nothing but compute."""

import re
from collections.abc import Iterator, Sequence, Set
from itertools import pairwise
from typing import Final

from truearm.programs.lexing import Token, tokens
from truearm.programs.rapid_instructions import COUNTING, HARMLESS, SETTINGS
from truearm.programs.rapid_values import OPERATORS, TOKENS
from truearm.programs.source import Source

PURE: Final = frozenset(
    {
        "abs", "acos", "asin", "atan", "atan2", "calcjointt", "calcrobt", "cjointt", "cos", "cpos", "crobt",
        "ctool", "cwobj", "defdframe", "defframe", "dim", "distance", "dotprod", "eulerzyx", "exp", "ispers",
        "isvar", "max", "min", "mirpos", "norient", "numtostr", "offs", "orientzyx", "orobt", "poseinv",
        "posemult", "posevect", "pow", "present", "reltool", "round", "sin", "sqrt", "tan", "trunc",
        "valtostr", "vectmagn",
    }
)  # fmt: skip
"""Functions of the controller that change nothing of what they are given."""
FUNCTIONS: Final = PURE | {
    "absdnum", "acosdnum", "ainput", "aoutput", "argname", "asindnum", "atan2dnum", "atandnum", "bitand",
    "bitanddnum", "bitcheck", "bitcheckdnum", "bitlsh", "bitlshdnum", "bitneg", "bitnegdnum", "bitor",
    "bitordnum", "bitrsh", "bitrshdnum", "bitxor", "bitxordnum", "bytetostr", "calcrotaxframez",
    "calcrotaxisframe", "cdate", "clkread", "corrread", "cosdnum", "crossprod", "cspeedoverride", "ctime",
    "dectohex", "defaccframe", "dinput", "dnumtonum", "dnumtostr", "doutput", "eventtype", "exechandler",
    "execlevel", "filesize", "filetimednum", "fssize", "getmecunitname", "getmodalpayloadmode",
    "getmotortorque", "getnextmechunit", "getnextsym", "getserviceinfo", "getsignalorigin", "getsysinfo",
    "gettaskname", "gettime", "gettspstatus", "getuasusername", "ginput", "ginputdnum", "goutput",
    "goutputdnum", "hextodec", "indinpos", "indspeed", "iounitstate", "isfile", "ismechunitactive",
    "isstopmoveact", "isstopstateevent", "issyncmoveon", "issysid", "maxrobspeed", "modexist", "modtime",
    "modtimednum", "motionplannerno", "nonmotionmode", "numtodnum", "opmode", "paridposvalid",
    "paridrobvalid", "pathlevel", "pathrecvalidbwd", "pathrecvalidfwd", "pfrestart", "powdnum",
    "ppmovedinmanmode", "progmemfree", "rawbyteslen", "readbin", "readdir", "readmotor", "readnum",
    "readstr", "readstrbin", "readvar", "remainingretries", "rmqgetslotname", "robname", "robos",
    "rounddnum", "runmode", "sindnum", "socketgetstatus", "socketpeek", "sqrtdnum", "strdigcalc",
    "strdigcmp", "strfind", "strlen", "strmap", "strmatch", "strmemb", "strorder", "strpart", "strtobyte",
    "strtoval", "tandnum", "taskisactive", "taskisexecuting", "taskrunmec", "taskrunrob", "tasksinsync",
    "testandset", "testdi", "testsignread", "textget", "texttabfreetouse", "texttabinstall",
    "triggdatavalid", "truncdnum", "type", "uialphaentry", "uiclientexist", "uidnumentry", "uidnumtune",
    "uilistview", "uimessagebox", "uinumentry", "uinumtune", "validio",
}  # fmt: skip
"""Functions of the controller, none of which moves the arm or displaces its targets."""
NO_FUNCTIONS: Final = OPERATORS | {"if", "elseif", "while", "test", "case", "from", "to", "step", "return"}
"""Words that an expression in parentheses may stand behind."""
_FUNCTION: Final = re.compile(
    r"^[ \t]*(?:LOCAL\s+)?FUNC\s+\w+\s+(\w+)\s*\([^)]*\)(.*?)^[ \t]*ENDFUNC\b",
    re.IGNORECASE | re.MULTILINE | re.DOTALL,
)
_STORAGE: Final = frozenset({"var", "const", "pers"})
_QUIET: Final = (HARMLESS - {"gripload", *SETTINGS}) | COUNTING | _STORAGE | NO_FUNCTIONS | {
    "then", "else", "endif", "for", "do", "endfor", "endwhile", "default", "endtest", "error", "undo",
    "retry", "trynext", "raise", "true", "false",
}  # fmt: skip
_BEFORE_OPERANDS: Final = HARMLESS | COUNTING | NO_FUNCTIONS | {
    "for", "(", "[", "{", ",", ":=", "=", "<", ">", "<=", ">=", "<>", "+", "-", "*", "/", "\\", ".",
}  # fmt: skip
_ASSIGNED: Final = frozenset({":=", ".", "{"})


def called(found: Sequence[Token]) -> Iterator[str]:
    """Names of the functions that an expression calls, in small letters.

    Args:
        found: Its tokens.
    """
    for token, behind in pairwise(found):
        if token.kind == "name" and behind.text == "(" and token.text.lower() not in NO_FUNCTIONS:
            yield token.text.lower()


def harmless(source: Source, routines: Set[str]) -> frozenset[str]:
    """Functions that neither move the arm nor displace its targets: of the controller, and of a module.

    Args:
        source: The module; of its functions those that compute, switch and wait, and call such alone.
        routines: Names of its routines, in small letters.
    """
    calls: dict[str, set[str]] = {}
    quiet: set[str] = set()
    for one in _FUNCTION.finditer(source.text):
        name, body = one.group(1).lower(), list(tokens(source.text, TOKENS, *one.span(2)))
        if all(_is_quiet(body, place) for place in range(len(body))) and name not in calls:
            quiet.add(name)
        else:
            quiet.discard(name)
        calls.setdefault(name, set()).update(called(body))
    others = FUNCTIONS - routines
    while busy := {name for name in quiet if not calls[name] <= quiet | others}:
        quiet -= busy
    return frozenset(quiet | others)


def _is_quiet(body: Sequence[Token], place: int) -> bool:
    """Whether a token begins no instruction that may do more than compute."""
    before = [token.text.lower() for token in body[max(place - 2, 0) : place]]
    behind = body[place + 1].text if place + 1 < len(body) else ""
    text = body[place].text.lower()
    return text != "%" and (
        body[place].kind != "name"
        or text in _QUIET
        or behind in _ASSIGNED | {"("}
        or not _STORAGE.isdisjoint(before)
        or not _BEFORE_OPERANDS.isdisjoint(before[-1:])
    )
