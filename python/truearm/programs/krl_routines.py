"""What routines a KRL program has and calls, and which of them leave tool, base and arm as they are."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

from truearm.programs.krl_orientation import HEEDING, MODAL, VAR, set_in
from truearm.programs.krl_storage import HEADER, is_data, lines
from truearm.programs.krl_values import line_reader
from truearm.programs.lexing import Token
from truearm.programs.source import Source

CALL: Final = re.compile(r"([A-Za-z_$][\w$]*)[ \t]*\(")
EXTERNAL: Final = frozenset({"ext", "extfct", "extp", "extfctp"})


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


KEYWORDS: Final = _words(
    "and b_and b_exor b_not b_or ca case delay do exor for if not or return sec step switch then to until "
    "wait when while"
)
COMPUTING: Final = _words(
    "abs acos atan2 cos sin sqrt tan forward inverse strcomp strdecllen strfind strlen varstate "
    "sacc_cp sacc_joint sapo sapo_ptp sbase scirc_m scirc_mode scirc_typ sgear_jerk sipo_mode sjerk sload "
    "sori_typ spath_jerk stool stool2 svel_cp svel_joint use_cm_pro_values arcgetdelay arcgetpath"
)
"""Functions of KUKA that only compute: they change nothing that they are given."""
LEAVING: Final = COMPUTING | _words(
    "arcmainng bas cast_from cast_to cclose cioctl clear_krldlg clear_krlmsg copen cread cwrite "
    "exists_krldlg exists_krlmsg get_msgbuffer ir_stopm krl_fclose krl_feof krl_fgetc krl_fopen krl_fprintf "
    "krl_freadln krl_fseek krl_fwriteln msgdialog msgloop msgnotify msgquit msgstate msgstatus pulse "
    "set_cd_params set_krldlg set_krlmsg sread stradd strclear strcopy swrite"
)
"""Routines of KUKA that change neither tool nor base and do not move the arm; BAS is read for itself."""
BAS_LEAVING: Final = frozenset({"acc_cp", "acc_ptp", "acc_glue", "cp_dat", "ptp_dat", "vel_cp", "vel_ptp"})
"""Commands of BAS that set neither tool nor base."""
BAS_ORIENTING: Final = frozenset({"cp_dat", "cp_params", ""})
"""Commands of BAS that set $ORI_TYPE, and what may be one of them."""
DOING_LATER: Final = frozenset({"trigger", "interrupt", "global"})
"""First words of statements that say what an interrupt or a trigger does."""
SETTING: Final = frozenset({"$tool", "$base", "$ipo_mode", "$load", "fdat_act"})


@dataclass(frozen=True)
class Routine:
    """A routine of a program.

    Attributes:
        name: In small letters; empty for what stands before all headers.
        file: Number of its file.
        start: Offset of its header.
        end: Offset behind its last line.
        visible: Whether programs in other files can call it.
    """

    name: str
    file: int
    start: int
    end: int
    visible: bool


def called(found: Sequence[Token]) -> list[str]:
    """Names of routines that tokens of a statement call, in small letters, in their order."""
    return [
        token.text.lower()
        for token, behind in pairwise(found)
        if behind.text == "(" and token.kind == "name" and token.text.lower() not in KEYWORDS
    ]


def immediate(found: list[Token]) -> tuple[list[Token], list[Token]]:
    """What a statement does at once, and what an interrupt or a trigger does later."""
    words = [token.text.lower() for token in found[:3]]
    starts = "trigger" in words[:1] or "interrupt" in words[:2]
    at = next(
        (place for place, token in enumerate(found) if starts and token.text.lower() == "do"), len(found)
    )
    return found[:at], found[at:]


def bas_command(words: Sequence[str]) -> tuple[str, str]:
    """Command and number of a call of BAS, whose tokens are in small letters; "?" for no number."""
    command = words[3] if len(words) > 3 and words[1:3] == ["(", "#"] else ""
    number = (
        words[5] if len(words) > 6 and words[4] == "," and words[5].isdigit() and words[6] == ")" else "?"
    )
    return command, number


def _sets_frames(words: Sequence[str]) -> bool:
    """Whether a statement, whose tokens are in small letters, sets tool, base, or what BAS sets them to."""
    return bas_command(words)[0] not in BAS_LEAVING if words[0] == "bas" else words[0] in SETTING


def _orients(words: Sequence[str]) -> bool:
    """Whether a statement makes that orientations may not count, or that BAS makes so."""
    if words[0] == "bas":
        return bas_command(words)[0] in BAS_ORIENTING
    return words[0] in MODAL and set_in(words) not in HEEDING


def _setting(mode: str) -> Callable[[Sequence[str]], bool]:
    """Tells whether a statement sets a mode in which orientations count."""

    def sets(words: Sequence[str]) -> bool:
        if words[0] == "bas":
            return mode == VAR and bas_command(words)[0] == "initmov"
        return words[0] in MODAL and set_in(words) == mode

    return sets


FRAMES: Final = "frames"
ORIENTATION: Final = "orientation"
SUBJECTS: Final = {FRAMES: _sets_frames, ORIENTATION: _orients} | {mode: _setting(mode) for mode in HEEDING}
"""What routines may leave as it is, and which statements set it."""


GIVEN: Final = {"$tool": FRAMES, "$base": FRAMES, "$ori_type": ORIENTATION}


def given_among(found: Sequence[Token]) -> set[str]:
    """Which of SUBJECTS a routine may set that is given what is among tokens."""
    return {GIVEN[word] for token in found if (word := token.text.lower()) in GIVEN}


def set_later(later: Sequence[Token], subject: str) -> bool:
    """Whether what an interrupt or a trigger does sets a subject, which stays until it is changed."""
    words = [token.text.lower() for token in later[1:]]
    return bool(words) and SUBJECTS[subject](words)


class Routines:
    """The routines of a program."""

    def __init__(self, sources: tuple[Source, ...]) -> None:
        self._sources = sources
        self._all = [routine for file in self._programs() for routine in self._of(file)]
        self._by_name = {routine.name: routine for routine in self._all if routine.name}
        self._by_place = {(routine.file, routine.start): routine for routine in self._all if routine.name}
        self._leaving: dict[str, dict[str, bool]] = {subject: {} for subject in SUBJECTS}
        self._wandering: dict[Routine, set[str]] = {}

    def _programs(self) -> list[int]:
        return [n for n, source in enumerate(self._sources) if not is_data(source)]

    def _of(self, file: int) -> list[Routine]:
        source = self._sources[file]
        headers = [found for place in lines(source) if (found := HEADER.match(source.text, *place))]
        starts = [*(found.start() for found in headers), len(source.text)]
        named = [
            Routine(found.group(2).lower(), file, start, end, number == 0 or bool(found.group(1)))
            for number, (found, (start, end)) in enumerate(zip(headers, pairwise(starts), strict=True))
        ]
        return [Routine("", file, source.first, starts[0], True), *named]

    def beginning(self, file: int, start: int) -> Routine | None:
        """The routine whose header is the line at offset `start`."""
        return self._by_place.get((file, start))

    def is_program(self, routine: Routine) -> bool:
        """Whether it is the program itself: the first routine of its file."""
        return routine is next(one for one in self._all if one.file == routine.file and one.name)

    def local(self, name: str) -> bool:
        """Whether a routine of that name is in the program."""
        return name in self._by_name

    def called_above_only(self, routine: Routine) -> bool:
        """Whether all calls of a routine stand above it."""
        source = self._sources[routine.file]
        line, _ = source.place(routine.start)
        behind = source.line_starts[line] if line < len(source.line_starts) else len(source.text)
        mention = re.compile(rf"(?<![\w$]){re.escape(routine.name)}[ \t]*\(", re.IGNORECASE)
        return not routine.visible and mention.search(source.text, behind) is None

    def leaves(self, name: str, subject: str = FRAMES) -> bool:
        """Whether a call of a routine certainly leaves tool and base, or another subject, as they are."""
        if name not in self._by_name:
            return name in LEAVING
        if name not in self._leaving[subject]:
            self._follow(name, subject)
        return self._leaving[subject][name]

    def changed_by(self, name: str, found: Sequence[Token]) -> set[str]:
        """Which of SUBJECTS a call of a routine among tokens may set."""
        given = given_among(found) if name not in LEAVING else set()
        return {subject for subject in SUBJECTS if subject in given or not self.leaves(name, subject)}

    def changed_later(self, later: Sequence[Token]) -> set[str]:
        """Which of SUBJECTS may be set by what an interrupt or a trigger does."""
        found = {subject for subject in SUBJECTS if set_later(later, subject)}
        return found.union(*(self.changed_by(name, later) for name in called(later)))

    def _follow(self, name: str, subject: str) -> None:
        """Find out of a routine, and of those that it calls, whether they leave a subject as it is."""
        callers: dict[str, set[str]] = {}
        followed, pending, leaving = set[str](), [name], self._leaving[subject]
        while pending:
            one = pending.pop()
            if one not in followed and one not in leaving:
                followed.add(one)
                routine = self._by_name[one]
                for inner in {
                    each
                    for place in self._body(routine)
                    for each in self._runs(routine.file, *place, subject)
                }:
                    callers.setdefault(inner, set()).add(one)
                    pending += [inner] if inner in self._by_name else []
        setting = [one for one in callers if one not in followed and not self.leaves(one, subject)]
        leaving |= dict.fromkeys(followed, True)
        while setting:
            changed = [one for one in callers.get(setting.pop(), ()) if leaving[one]]
            leaving |= dict.fromkeys(changed, False)
            setting += changed

    def wandering(self, file: int, at: int) -> set[str]:
        """Which of FRAMES and ORIENTATION the routine around a label sets where a GOTO may lead around it."""
        routine = next(one for one in self._all if one.file == file and one.start <= at < one.end)
        if routine not in self._wandering:
            jumped, found = False, set[str]()
            for place in self._body(routine):
                words = self._words(file, *place)
                jumped |= words[:1] == ["goto"] or words[1:2] == [":"]
                found |= self._set_in(file, *place) if jumped else set()
            self._wandering[routine] = {one if one == FRAMES else ORIENTATION for one in found}
        return self._wandering[routine]

    @cached_property
    def given(self) -> frozenset[str]:
        """Names that routines are given and may change, in small letters."""
        found: set[str] = set()
        for file in self._programs():
            source = self._sources[file]
            for start, end in lines(source):
                names = {one.group(1).lower() for one in CALL.finditer(source.text, start, end)}
                if names - KEYWORDS - COMPUTING - {"bas"} and HEADER.match(source.text, start, end) is None:
                    found |= _arguments(list(line_reader(source, start, end).rest()))
        return frozenset(found)

    def _body(self, routine: Routine) -> Iterator[tuple[int, int]]:
        source = self._sources[routine.file]
        first = source.place(routine.start)[0] - 1
        starts = [*source.line_starts, len(source.text)]
        for place in range(first, len(starts) - 1):
            if starts[place] >= routine.end:
                return
            if starts[place] > routine.start or not routine.name:
                yield max(starts[place], source.first), starts[place + 1]

    def _words(self, file: int, start: int, end: int) -> list[str]:
        return [token.text.lower() for token in line_reader(self._sources[file], start, end).rest()]

    def _set_in(self, file: int, start: int, end: int) -> set[str]:
        """Which of SUBJECTS a line may set."""
        return {
            subject
            for subject in SUBJECTS
            if not all(self.leaves(name, subject) for name in self._runs(file, start, end, subject))
        }

    def _runs(self, file: int, start: int, end: int, subject: str) -> set[str]:
        """Names of the routines that a line calls; an empty one where it sets a subject itself."""
        found = line_reader(self._sources[file], start, end).rest()
        words = [token.text.lower() for token in found]
        if not words or words[0] in EXTERNAL:
            return set()
        names = set(called(found))
        given = subject in given_among(found) and not names <= LEAVING
        sets = given or SUBJECTS[subject](words) or set_later(immediate(found)[1], subject)
        return {*names, *([""] if sets else [])}


def _arguments(found: list[Token]) -> set[str]:
    """Variables, with an index that is a number, within the parentheses of calls that may change them."""
    texts = [token.text.lower() for token in found]
    names: set[str] = set()
    around: list[bool] = []
    for place, text in enumerate(texts):
        if text == "(":
            function = place > 0 and found[place - 1].kind == "name" and texts[place - 1] not in KEYWORDS
            changing = function and texts[place - 1] not in COMPUTING | {"bas"}
            around.append(changing or (not function and bool(around) and around[-1]))
        elif text == ")" and around:
            around.pop()
        elif found[place].kind == "name" and around and around[-1]:
            indexed = texts[place + 1 : place + 2] == ["["] and texts[place + 3 : place + 4] == ["]"]
            names.add(f"{text}[{texts[place + 2]}]" if indexed else text)
    return names
