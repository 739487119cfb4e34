"""One's own travel models: from a table or from a function."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..validation import Array, as_array
from .model import Beyond, Distance, TravelModel, travel_model


def from_table(
    grades: npt.ArrayLike,
    paces: npt.ArrayLike,
    *,
    unit: str = "s",
    distance: Distance = "horizontal",
    beyond: Beyond = "refuse",
    name: str = "table",
    source: str = "a table",
) -> TravelModel:
    """A travel model from measured paces, straight between the rows.

    grades : (k,), three or more, increasing, from below 0 to above 0.
    paces : (k,), ``unit`` per metre of ``distance``.
    beyond : grades steeper than the table are refused where it does not say what to do there, that
        is, where the last row is the critical grade; or they are climbed in ``"switchbacks"`` at
        the last row.

    Raises InputError where there are fewer rows, grades do not increase, or paces are not finite or
    so far below 0 that no gauge mends it.
    """
    x = as_array(grades, "grades", shape=(None,))
    y = as_array(paces, "paces", shape=(None,))
    if len(x) != len(y):
        raise InputError(f"grades has {len(x)} rows and paces {len(y)}; give one pace for each")
    if len(x) < 3:
        raise InputError(
            f"grades has {len(x)} rows; a table needs three or more, such as a descent, level "
            "ground and a climb"
        )
    falling = np.flatnonzero(np.diff(x) <= 0)
    if len(falling):
        k = int(falling[0])
        raise InputError(
            f"grades must increase from row to row; row {k + 1} is {x[k]:g} and row {k + 2} "
            f"{x[k + 1]:g}: sort the table, and leave out rows of the same grade"
        )
    return travel_model(
        name,
        partial(_interpolated, x, y),
        unit=unit,
        source=source,
        grades=(float(x[0]), float(x[-1])),
        kinks=x[1:-1].tolist(),
        distance=distance,
        beyond=beyond,
        options={"rows": len(x)},
    )


def _interpolated(x: Array, y: Array, grades: Array) -> Array:
    return np.asarray(np.interp(grades, x, y))


def from_function(
    pace: Callable[[Array], Any],
    *,
    grades: tuple[float, float] = (-2.0, 2.0),
    kinks: Iterable[float] = (),
    unit: str = "s",
    distance: Distance = "horizontal",
    beyond: Beyond = "refuse",
    name: str = "function",
    source: str = "a function",
) -> TravelModel:
    """A travel model from a Python function, which is tabulated.

    The table agrees with the function to 2e-13 of its values. Kinks that ``kinks`` does not name
    are found, to about 1e-10.

    pace : from an array of grades to an array of paces, ``unit`` per metre of ``distance``.
    grades : the range where it holds, infinite for all grades. It is called nowhere else.
    beyond : as in ``from_table``.

    Raises InputError where the function fails, is not finite, is too rough, or is so far below 0
    that no gauge mends it.
    """
    if not callable(pace):
        raise InputError(f"pace={pace!r} is not a function; give one from grades to paces")
    return travel_model(
        name,
        pace,
        unit=unit,
        source=source,
        grades=grades,
        kinks=as_array(list(kinks), "kinks", shape=(None,)).tolist(),
        distance=distance,
        beyond=beyond,
        options={"grades": grades},
    )
