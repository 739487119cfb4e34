"""A package of a few kernels with the project's own compiler, for tests that edit or break it."""

import shutil
import textwrap
from pathlib import Path

from terrapath import errors
from terrapath._kernels import compiler

KERNELS = Path(compiler.__file__).parent
MACHINERY = ("cache", "compiler", "dispatch", "fallback", "linking", "signatures")


def copy_machinery(folder, **modules):
    """Make ``copied`` in a folder: its kernels are these modules, ``a__b`` for one in a sub-folder.

    A module is written with absolute imports, and tests change it as they like.
    """
    kernels = folder / "copied" / "_kernels"
    kernels.mkdir(parents=True)
    shutil.copy(errors.__file__, kernels.parent / "errors.py")
    for name in MACHINERY:
        shutil.copy(KERNELS / f"{name}.py", kernels)
    for name, source in modules.items():
        place = kernels / f"{name.replace('__', '/')}.py"
        place.parent.mkdir(exist_ok=True)
        place.write_text("from copied._kernels.compiler import *\n" + textwrap.dedent(source))
    return kernels
