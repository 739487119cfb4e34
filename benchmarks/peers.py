"""Peers, which are other programs that do the same: loaded, or named as missing."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from typing import Any


@dataclass(frozen=True)
class Peer:
    """A Python package to measure against."""

    name: str  # of the distribution
    module: str

    def load(self) -> Any | None:
        """Its module; None where it is not installed."""
        try:
            return import_module(self.module)
        except ImportError:
            return None

    @property
    def version(self) -> str | None:
        """The version that is installed; None where none is."""
        return None if self.load() is None else version(self.name)

    @property
    def missing(self) -> str:
        """A sentence for the report where it is not installed."""
        return (
            f"{self.name} is not installed and was left out; `pip install 'terrapath[bench]'` "
            "installs it."
        )


SCIKIT_FMM = Peer("scikit-fmm", "skfmm")
SCIKIT_IMAGE = Peer("scikit-image", "skimage.graph")
POTPOURRI = Peer("potpourri3d", "potpourri3d")
PYGEODESIC = Peer("pygeodesic", "pygeodesic.geodesic")
OMPL_PYTHON = Peer("ompl", "ompl.geometric")
