"""The command's entry point: its sub-commands, and errors as one line and an exit code."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterable
from importlib import import_module
from typing import Annotated, Any

import typer

from .. import __version__
from ..errors import TerrapathError
from .console import ExitCode, remark, remarks, settle, without_broken_messages

# Typer brings its own copy of Click, or uses the installed one, by version; the base of
# its usage errors is reached through the one it exports.
UsageError: Any = typer.BadParameter.__mro__[1]

# Each stands in a module of its name, as ``plan_command`` in ``plan``.
COMMANDS = ("plan", "check", "field", "init", "schema", "scenes", "reproduce", "warmup")


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"terrapath {__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show it.")
    ] = False,
) -> None:
    pass


def application(names: Iterable[str] = COMMANDS) -> typer.Typer:
    """The command with some of its sub-commands; only their modules are imported."""
    app = typer.Typer(
        help="Optimal paths on terrain, with proof.",
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_root)
    for name in names:
        module = import_module(f".{name}", __package__)
        app.command(name)(getattr(module, f"{name}_command"))
    return app


def _asked(arguments: list[str]) -> Iterable[str]:
    """The sub-commands that must be known to answer: the one that is called, or all."""
    return arguments[:1] if arguments[:1] and arguments[0] in COMMANDS else COMMANDS


def _fail(message: str) -> int:
    """One line on standard error."""
    remark(message)
    return ExitCode.BAD_INPUT


def _not_shown(reason: object) -> int:
    """What there is to show has nowhere to go."""
    remark(
        f"standard output cannot be written: {reason}; send it elsewhere, or keep the answer by "
        "--output FILE"
    )
    return ExitCode.NOT_SHOWN


def run(arguments: list[str] | None = None, command: typer.Typer | None = None) -> int:
    """Run the command and return its exit code; no error escapes as a traceback."""
    given = sys.argv[1:] or ["--help"] if arguments is None else arguments
    try:
        with remarks(), without_broken_messages():
            app = command or application(_asked(given))
            return app(given, standalone_mode=False) or ExitCode.SOLVED
    except UsageError as error:
        return _fail(error.format_message())
    except TerrapathError as error:
        return _fail(str(error))
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except SystemExit:  # of Rich and Click, where whoever read standard output has gone
        return _not_shown("nobody reads it")
    except OSError as error:
        # What goes wrong with a file is a MapError: what names none is the stream's.
        if error.errno is None or error.filename is not None:
            raise
        return _not_shown(error.strerror)


def main() -> None:
    """Entry point of the ``terrapath`` script."""
    # What is imported stays. To look it all over for garbage as often as a process should that
    # runs for days, and once more at the end, takes a seventh of the time of a plan on a scene.
    gc.set_threshold(20_000, 20, 100)
    code = run()
    settle(sys.__stdout__, sys.__stderr__)
    gc.freeze()
    sys.exit(code)
