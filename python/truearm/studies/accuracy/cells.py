"""The questions of the study: a set, a split, a number of training poses and a seed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from truearm.defaults import SEED
from truearm.errors import InputError, Notice, TruearmError, UsageError, count_of, list_names
from truearm.studies.accuracy.sets import DataSet, read_set
from truearm.studies.accuracy.splits import TITLES, Cut, Kind, cuts, divide, rows_of, why_no_cut

ALL: Final = "all"
MOST_TRAINING: Final = 2000
SIZES: Final = ("25", "50", "100", "200", "400", ALL)
SOONER: Final[tuple[str, ...]] = ("400", "100")
"""Sizes that are looked at first, so that an interrupted study has told most."""


@dataclass(frozen=True)
class Cell:
    """One question: how far are methods off that learned from these rows?

    Attributes:
        data_set: The set.
        cut: How rows are held out.
        size: Training poses as it was asked for, "all" for as many as there are, 2000 at the most.
        poses: Training poses.
        seed: Of the split.
    """

    data_set: DataSet
    cut: Cut
    size: str
    poses: int
    seed: int


@dataclass(frozen=True)
class Asked:
    """What is asked of every set.

    Attributes:
        kinds: Kinds of splits.
        split_by: Columns of the split "groups".
        sizes: Numbers of training poses, and "all".
        seeds: Seeds.
        stated: Those of the kinds that were named: of these it is told where a set does not allow them.
    """

    kinds: tuple[Kind, ...]
    split_by: tuple[str, ...]
    sizes: tuple[str, ...]
    seeds: tuple[int, ...]
    stated: tuple[Kind, ...] = ()


def parse_sizes(text: str) -> tuple[str, ...]:
    """Sizes from "25,50,all".

    Raises:
        UsageError: If one is neither a positive number nor "all", or is named twice.
    """
    sizes = [part.strip() for part in text.split(",")]
    for size in sizes:
        if size != ALL and not (size.isascii() and size.isdigit() and int(size) > 0):
            raise UsageError(
                f'"{size}" is no number of poses', where="--sizes", rule="Such as 25,100,400,all"
            )
    sizes = [size if size == ALL else str(int(size)) for size in sizes]
    if len(set(sizes)) < len(sizes):
        raise UsageError(f'"{text}"', where="--sizes", rule="Each size once")
    return tuple(sizes)


def study_seeds(count: int) -> tuple[int, ...]:
    """The seed of `truearm calibrate`, then those that follow from 0."""
    return (SEED, *(seed for seed in range(count) if seed != SEED))[:count]


def list_cells(sets: Sequence[DataSet], asked: Asked) -> list[Cell]:
    """All questions, those that tell most first: seed by seed, the middle sizes before the others.

    Sizes beyond what is left to train on are left out, and so is what `check_askable` tells of.
    """
    order = [size for size in SOONER if size in asked.sizes]
    order += [size for size in asked.sizes if size not in order]
    return [
        cell
        for turn, seed in enumerate(asked.seeds)
        for size in order
        for kind in sorted(asked.kinds, key=lambda kind: kind == "tails")
        for one in sets
        for cell in _cells_of(one, kind, size, (turn, seed), asked.split_by)
        if isinstance(cell, Cell)
    ]


def check_askable(sets: Sequence[DataSet], asked: Asked) -> list[Notice]:
    """Notices of the sets of which nothing can be asked, and of splits that a set does not allow.

    Raises:
        InputError: If that is so of all sets.
    """
    empty = [one for one in sets if not list_cells([one], asked)]
    why = [_unaskable(one, asked) for one in empty]
    if len(empty) == len(sets):
        raise InputError(
            "; ".join(why),
            rule="A question needs a split that its measurements allow, and rows enough to train on",
            way_out="Give smaller --sizes, other --splits, or more measurements",
        )
    nothing = [Notice("no_question", f"Nothing is asked of a set: {words}.") for words in why]
    others = [one for one in sets if one not in empty]
    return [*nothing, *(notice for one in others for notice in _left_out(one, asked))]


def _unaskable(data_set: DataSet, asked: Asked) -> str:
    read = read_set(data_set)
    possible = cuts(read, asked.kinds, asked.split_by, 0)
    what = f"{data_set.file} has {count_of(len(read.data), 'row')}"
    if not possible:
        return f"{what}, which cannot be split by {list_names(asked.kinds, 'or')}"
    refused = _refused(data_set, asked)
    if refused:
        return f"{what}; {next(iter(refused))}"
    most = max(len(divide(data_set, cut, asked.seeds[0]).train) for cut in possible)
    return f"{what}, of which {most} can train, fewer than the {' or '.join(asked.sizes)} asked for"


def _left_out(data_set: DataSet, asked: Asked) -> list[Notice]:
    """Notices of the splits that a set does not allow, and of which seeds and sizes where it is not all."""
    notices, read = list[Notice](), read_set(data_set)
    for kind in asked.stated:
        if why := why_no_cut(read, kind, asked.split_by):
            notices.append(Notice("no_split", f"Left out of {data_set.name}: {TITLES[kind]}, because {why}."))
    for words, found in _refused(data_set, asked).items():
        seeds, sizes = (list(dict.fromkeys(each)) for each in zip(*found, strict=True))
        of = f"seed {', '.join(map(str, seeds))}; poses {', '.join(sizes)}"
        notices.append(Notice("no_split", f"Left out of {data_set.name}: {words} ({of})."))
    return notices


def _refused(data_set: DataSet, asked: Asked) -> dict[str, list[tuple[int, str]]]:
    """Seeds and sizes that a split cannot be asked with, by the split and the reason in words."""
    found: dict[str, list[tuple[int, str]]] = {}
    for turn, seed in enumerate(asked.seeds):
        for kind in asked.kinds:
            for size in asked.sizes:
                for one in _cells_of(data_set, kind, size, (turn, seed), asked.split_by):
                    if not isinstance(one, Cell):
                        found.setdefault(one, []).append((seed, size))
    return found


def _cells_of(
    data_set: DataSet, kind: Kind, size: str, seed: tuple[int, int], split_by: Sequence[str]
) -> Iterator[Cell | str]:
    """The questions of a kind of split, and in words which of its ways to hold out rows cannot be asked."""
    for cut in cuts(read_set(data_set), (kind,), split_by, seed[0]):
        try:
            available = min(len(divide(data_set, cut, seed[1]).train), MOST_TRAINING)
            poses = available if size == ALL else int(size)
            if poses <= available:
                rows_of(data_set, cut, seed[1], poses)
                yield Cell(data_set, cut, size, poses, seed[1])
        except TruearmError as error:
            yield f"{cut}, because {error.what}"
