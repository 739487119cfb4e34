"""The reproduction of the paper's section 5 in one directory: trials, pictures, report."""

from __future__ import annotations

import json
import os
from pathlib import Path

from .. import __version__
from .._support.files import require_writable, written_whole
from .._support.watching import Watch, watch_nothing
from ..errors import InputError, MapError
from ..validation import require_count, require_seed
from .experiments import EXPERIMENTS, FULL, QUICK, Settings
from .figures import draw
from .report import make_report
from .runner import Runner
from .trials import Store

ALL = "all"
SETTINGS_FILE = "settings.json"
REPORT_FILE = "report.md"
TRIALS = "trials"


def chosen_experiments(what: str) -> list[str]:
    """The names of the experiments that ``what`` stands for; InputError where it is not known."""
    if what == ALL:
        return list(EXPERIMENTS)
    if what not in EXPERIMENTS:
        known = ", ".join([ALL, *EXPERIMENTS])
        raise InputError(f"what={what!r} is not known; choose one of {known}")
    return [what]


def claim(directory: Path, record: dict[str, object]) -> None:
    """Make the output directory, or check that it belongs to a run with the same settings.

    Raises InputError where it does not, and MapError where it cannot be written.
    """
    where = f"output={str(directory)!r}"
    remedy = "name another --output, or delete it"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        visible = [entry for entry in directory.iterdir() if not entry.name.startswith(".")]
        file = directory / SETTINGS_FILE
        if file in visible:
            _require_same(file, record, f"{where} belongs to", remedy)
        elif visible:
            raise InputError(f"{where} holds {visible[0].name} and no {SETTINGS_FILE}; {remedy}")
        else:
            with written_whole(file) as temporary:
                temporary.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
        (directory / TRIALS).mkdir(exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise MapError(
            f"{where} cannot be written: {reason}; name a directory that you may write to"
        ) from None


def _require_same(file: Path, record: dict[str, object], belongs: str, remedy: str) -> None:
    try:
        other = json.loads(file.read_text(encoding="utf-8"))
    except ValueError:
        other = None
    if other == record:
        return
    if not isinstance(other, dict):
        raise InputError(f"{belongs} a run whose {SETTINGS_FILE} cannot be read; {remedy}")
    shown = ", ".join(f"{name}={other.get(name)!r}" for name in record)
    wanted = ", ".join(f"{name}={value!r}" for name, value in record.items())
    raise InputError(f"{belongs} a run with {shown}, not {wanted}; {remedy}")


def reproduce(
    what: str = ALL,
    output: str | Path = "reproduction",
    *,
    quick: bool = False,
    seed: int = 0,
    workers: int | None = None,
    watch: Watch = watch_nothing,
) -> Path:
    """Run experiments of the paper, draw their figures and write a report.

    what : "all" or one of ``EXPERIMENTS``. output : a directory; a run that was stopped there
    continues. quick : fewer samples and runs. seed : of the first trial. workers : the number of
    processes; by default one for each core. watch : gets the progress. Returns the report's path.
    Raises InputError where the directory belongs to a run with other settings, MapError where it
    cannot be written.
    """
    names = chosen_experiments(what)
    require_seed(seed)
    count = workers if workers is not None else os.cpu_count() or 1
    require_count(workers=count)
    directory = Path(output)
    claim(directory, {"version": __version__, "quick": quick, "seed": seed})
    for file in (directory / REPORT_FILE, directory / TRIALS / REPORT_FILE):
        require_writable(file)
    settings = Settings(scale=QUICK if quick else FULL, seed=seed)
    with Runner(Store(directory / TRIALS), count, watch) as runner:
        data = {name: EXPERIMENTS[name](settings, runner) for name in names}
    found = {}
    for done, name in enumerate(names):
        watch("pictures", done, len(names))
        found[name] = (data[name], draw(name, data[name], settings, directory))
    watch("pictures", len(names), len(names))
    report = directory / REPORT_FILE
    with written_whole(report) as temporary:
        temporary.write_text(make_report(found, settings), encoding="utf-8")
    return report
