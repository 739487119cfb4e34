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
from .console import Closed, ExitCode, remark, remarks, settle, without_broken_messages

# Some versions of Typer bring their own copy of Click, and others use the installed one. So the
# class is taken from Typer: it is the base of a usage error that Typer exports.
UsageError: Any = typer.BadParameter.__mro__[1]

# Each is in the module of its name, such as ``plan_command`` in ``plan``.
COMMANDS = (
    "plan",
    "check",
    "field",
    "travel",
    "init",
    "schema",
    "scenes",
    "reproduce",
    "warmup",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"terrapath {__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    pass


def application(names: Iterable[str] = COMMANDS) -> typer.Typer:
    """The command with some of its sub-commands; no other modules are imported."""
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


def _needed(arguments: list[str]) -> Iterable[str]:
    """The sub-commands to import: the one that is called, or all."""
    return arguments[:1] if arguments[:1] and arguments[0] in COMMANDS else COMMANDS


def _fail(message: str) -> int:
    """Print the message, and return the exit code for bad input."""
    remark(message)
    return ExitCode.BAD_INPUT


def _not_shown(reason: object) -> int:
    """Print that standard output cannot be written, and return the exit code for that."""
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
            app = command or application(_needed(given))
            return app(given, standalone_mode=False) or ExitCode.SOLVED
    except UsageError as error:
        return _fail(error.format_message())
    except TerrapathError as error:
        return _fail(str(error))
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except SystemExit:  # by Rich or Click, where the reader of standard output has closed it
        return _not_shown("nobody reads it")
    except OSError as error:
        # A failure with a file is a MapError; an error without a file name is of the stream.
        if error.errno is None or error.filename is not None:
            raise
        return _not_shown(error.strerror)


def main() -> None:
    """Entry point of the ``terrapath`` script."""
    # Imported objects stay until the end. Python's default garbage collection would examine them
    # often, and once more at the end. That takes a seventh of the time of a plan on a scene.
    gc.set_threshold(20_000, 20, 100)
    if sys.stdout is None:
        sys.stdout = Closed()
    code = run()
    settle(sys.__stdout__, sys.__stderr__)
    gc.freeze()
    sys.exit(code)
