"""The commands, their options and their exit codes, as the program itself declares them."""

from __future__ import annotations

import inspect
import re
from typing import Any

import typer

from making import markdown
from stickslip.cli.app import app
from stickslip.cli.common import ending

_CODES = [
    ("0", "the result was computed and is certified"),
    (
        str(ending.NOT_CERTIFIED),
        "computed, but not certified or not complete; files are written",
    ),
    ("2", "invalid input: one line gives the place, the reason and the remedy; nothing is written"),
    ("70", "internal error; please report it"),
    (str(ending.EXIT_INTERRUPTED), "interrupted (Ctrl-C); results so far are kept"),
]


def pages() -> dict[str, str]:
    """One page: every command, option and exit code."""
    program: Any = typer.main.get_command(app)
    parts: list[str] = []
    for name, command in program.commands.items():
        if not command.hidden:
            parts += _command(name, command)
    page = markdown.filled(
        "command-line",
        help=program.help,
        codes=markdown.table(["code", "meaning"], _CODES),
        commands="\n".join(parts),
    )
    return {"reference/command-line.md": page}


def _command(name: str, command: Any) -> list[str]:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option" and not p.hidden]
    usage = " ".join(["stickslip", name, *(p.metavar or p.name.upper() for p in arguments)])
    parts = [f"## {name}\n", markdown.block("text", usage + (" [OPTIONS]" if options else ""))]
    parts.append(_escaped(inspect.cleandoc(command.help or "")) + "\n")
    rows = [[markdown.code(p.metavar or p.name), p.help or ""] for p in arguments]
    context = command.make_context(name, [], resilient_parsing=True)
    records = [p.get_help_record(context) for p in options]
    rows += [[markdown.code(names), " ".join(help_.split())] for names, help_ in records]
    if rows:
        parts.append(markdown.table(["", "meaning"], [[a, _escaped(b)] for a, b in rows]))
    return parts


def _escaped(text: str) -> str:
    """A text of the program, whose options are code: two hyphens would become a dash."""
    plain = text.replace("*", r"\*").replace("<", r"\<").replace("$", r"\$")
    return re.sub(r"(?<![\w-])--[a-z][\w-]*", r"`\g<0>`", plain)
