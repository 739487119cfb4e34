"""Packages that announce planners or travel models by entry points, as pip lays them out."""

import contextlib
import importlib

from terrapath._support.plug_ins import announced


@contextlib.contextmanager
def installed_package(tmp_path, monkeypatch, name, module, entries):
    """A package of one module is there to be imported, with its entry points."""
    (tmp_path / f"{name}.py").write_text(module)
    about = tmp_path / f"{name}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(entries)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    announced.cache_clear()
    yield
    announced.cache_clear()
