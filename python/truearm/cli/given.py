"""The options that a command was given, for commands that it names."""

import typer

from truearm.errors import typed


def given_options(context: typer.Context, *left_out: str) -> str:
    """Options as they were typed, with a space before them; "" without any.

    Args:
        context: Of the command.
        left_out: Names of parameters that are not wanted.
    """
    words: list[str] = []
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        if name in left_out or parameter.param_type_name != "option":
            continue
        if source is None or source.name != "COMMANDLINE":
            continue
        value = context.params[name]
        for one in value if isinstance(value, list | tuple) else [value]:
            words += [parameter.opts[-1]] if one is True else [parameter.opts[-1], str(one)]
    return "".join(f" {typed(word)}" for word in words)
