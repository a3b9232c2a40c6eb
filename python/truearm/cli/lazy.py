"""Commands that are imported when they are called, so that help and completion are quick."""

import inspect
import re
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any, Final

import typer
from typer.core import TyperCommand, TyperGroup

from truearm.cli.arguments import offer_choices
from truearm.cli.entry import Entry

INTERRUPTED_BY_TYPER: Final = 130
EXAMPLES: Final = re.compile(r"\n\n(?=Examples:\n)")
AS_IT_STANDS: Final = "\n\n\b\n"


class LazyCommand(TyperCommand):
    """Stands for a command in lists; becomes the real one when it is to run."""

    def __init__(self, entry: Entry) -> None:
        super().__init__(name=entry.name, help=entry.summary, rich_markup_mode=None)
        self._entry = entry

    def make_context(self, info_name: str | None, args: list[str], *more: Any, **extra: Any) -> Any:  # noqa: ANN401
        """The context of the real command."""
        return self.load().make_context(info_name, args, *more, **extra)

    def load(self) -> Any:  # noqa: ANN401
        """The real command."""
        module = import_module(self._entry.module)
        if hasattr(module, "COMMANDS"):
            return group(module.COMMANDS, _nothing, help_text=module.HELP, name=self._entry.name)
        offer_choices(module.command)
        application = typer.Typer(add_completion=False, rich_markup_mode=None)
        text = module.command.__doc__ or self._entry.summary  # python -OO keeps no docstrings
        application.command(self._entry.name, help=_shown(text))(module.command)
        return typer.main.get_command(application)


def group(
    entries: Sequence[Entry], callback: Callable[..., None], *, help_text: str, name: str | None = None
) -> Any:  # noqa: ANN401
    """A command that is a table of commands; `callback` has its own options."""

    class Group(TyperGroup):
        def __init__(self, **attributes: Any) -> None:
            super().__init__(**attributes)
            self.commands = {entry.name: LazyCommand(entry) for entry in entries}

        def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401
            return list(self.commands)

    application = typer.Typer(
        name=name,
        cls=Group,
        add_completion=name is None,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )
    application.callback(no_args_is_help=True, help=_shown(help_text))(callback)
    return typer.main.get_command(application)


def build(entries: Sequence[Entry], help_text: str) -> Callable[[list[str]], int]:
    """The program over a table of commands: takes the words behind its name, returns the exit status."""
    program = group(entries, _program, help_text=help_text)

    def run(arguments: list[str]) -> int:
        try:
            program(args=arguments, prog_name="truearm")
        except SystemExit as stop:
            if stop.code == INTERRUPTED_BY_TYPER:
                raise KeyboardInterrupt from None
            return stop.code if isinstance(stop.code, int) else 0
        return 0

    return run


def _shown(text: str) -> str:
    """Help as it is shown: paragraphs are filled, lines of examples stay."""
    return EXAMPLES.sub(AS_IT_STANDS, inspect.cleandoc(text))


def _nothing() -> None:
    return None


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"truearm {version('truearm')}")
        raise typer.Exit


def _program(
    asked_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    return None
