"""What the reader of a program gathers on its way through the text."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from truearm.errors import InputError
from truearm.programs.configuration import Configuration, configured
from truearm.programs.environment import Environments
from truearm.programs.layouts import Layout
from truearm.programs.listing import listed_at
from truearm.programs.program import Language, LineCount, Listed, Program, Unplaced
from truearm.programs.source import Source
from truearm.programs.tables import Motion, MoveTable, Targets, TargetTable, Via


@dataclass(eq=False)
class Gathered:
    """What was found so far; attributes that are not told here are those of Program.

    Attributes:
        targets: Numbers that are targets.
        moves: Uses of them.
        environments: With what they are used.
    """

    sources: tuple[Source, ...]
    targets: TargetTable = field(default_factory=TargetTable)
    moves: MoveTable = field(default_factory=MoveTable)
    environments: Environments = field(default_factory=Environments)
    listed: list[Listed] = field(default_factory=list)
    accurate: str = ""
    fixed: dict[int, str] = field(default_factory=dict)
    unsure: set[int] = field(default_factory=set)
    nearest: dict[int, bool] = field(default_factory=dict)
    vias: dict[int, Via] = field(default_factory=dict)
    unplaced: list[Unplaced] = field(default_factory=list)
    line_count: LineCount | None = None

    def leave(self, place: tuple[int, int], reason: str, name: str = "") -> None:
        """What stands at a place, file and offset, is left as it is; without a name its line tells what."""
        self.listed.append(listed_at(self.sources, place, name, reason))

    def unplace(self, place: tuple[int, int], motion: Motion, *, blended: bool) -> None:
        """The motion of a statement leads to no numbers of the program."""
        self.unplaced.append(Unplaced(*place, motion, blended))

    def keep(self, which: Iterable[int], reason: str) -> None:
        """Targets cannot be changed with certainty; of several reasons the first one counts."""
        for number in which:
            self.fixed.setdefault(number, reason)

    def program(
        self,
        language: Language,
        layouts: tuple[Layout, ...],
        configuration: Callable[[], Configuration] | None = None,
    ) -> Program:
        """The program.

        Args:
            language: Who read it.
            layouts: As in Program.
            configuration: Makes what configuration data means; raises InputError for an arm whose branches
                nobody can tell by it, and targets that state some are kept then.
        """
        targets = self.targets.freeze()
        meaning = None if configuration is None else self._meaning(configuration, targets, layouts)
        return Program(
            language=language,
            sources=self.sources,
            layouts=layouts,
            targets=targets,
            moves=self.moves.freeze(),
            environments=tuple(self.environments.all),
            listed=tuple(sorted(self.listed)),
            configuration=meaning,
            accurate=self.accurate,
            fixed=self.fixed,
            unsure=self.unsure,
            nearest=self.nearest,
            vias=self.vias,
            unplaced=self.unplaced,
            line_count=self.line_count,
        )

    def _meaning(
        self, configuration: Callable[[], Configuration], targets: Targets, layouts: tuple[Layout, ...]
    ) -> Configuration | None:
        try:
            return configuration()
        except InputError as unsuited:
            self.keep(configured(targets, layouts), unsuited.what)
            return None
