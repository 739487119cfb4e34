"""A travel model: a pace function, relaxed to what switchbacks make of it, with its lower lines."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from .._kernels.travel.paces import (
    Pace,
    evaluate_intercepts,
    evaluate_jets,
    evaluate_paces,
)
from ..errors import InputError
from ..validation import Array, as_array, require_choice, require_positive
from .pieces import Formula, Pieces, evaluate, fit
from .relaxation import End, relax

Distance = Literal["horizontal", "slope"]
Beyond = Literal["switchbacks", "refuse"]
Grades = tuple[float, float]

# A pace for all grades is tabulated up to this one, 84 degrees, and goes straight on beyond.
STEEPEST = 10.0
# The lower lines of a model come this close to the pace, as a share of it.
LINES_TOLERANCE = 1e-6
# A jump of the slope below this share of the pace of level ground is rounding.
NO_KINK = 1e-7


@dataclass(frozen=True, eq=False, repr=False)
class TravelModel:
    """What a horizontal metre costs at each grade, in time or energy, with its best switchbacks.

    Calling it gives the **relaxed** pace P(m) at grades m: rise over horizontal distance, above 0
    uphill. P is convex, and never above the pace of the source, which ``raw`` gives. Between the
    critical grades they are the same, except where ``bridges`` says; beyond them P is what
    switchbacks at the critical grade cost.

    name : such as ``"tobler"``. options : the arguments it was made with.
    unit : of the cost of a path: ``"s"``, ``"J"`` or ``"J/kg"``; paces are per horizontal metre.
    source : the literature.
    grades : the range of grades that the pace is used for. Infinite ends mean that it is used for
        all grades.
    distance : whether the source's pace is per ``"horizontal"`` metre or per metre of ``"slope"``
        distance. ``raw`` and P are per horizontal metre in both cases.
    critical : the grades, down and up, beyond which switchbacks are better; infinite where they
        never are.
    bridges : ranges of grades between the critical ones where the pace is not convex. There P is
        below the pace: paths come close to it by mixing the grades at the bridge's ends, the closer
        the steeper the ground is, and cannot always reach it. So P is a lower bound.
    gauge : a cost b per metre of height such that P(m) - b m is above 0 everywhere; 0 where P is.
    pace : P as arrays for kernels, with kinks and lower lines.
    beyond : what a grade outside ``grades`` means: ``"switchbacks"`` at the end of the range, or
        ``"refuse"``, an error.
    """

    name: str
    unit: str
    source: str
    grades: Grades
    distance: Distance
    critical: Grades
    bridges: tuple[Grades, ...]
    gauge: float
    pace: Pace
    beyond: Beyond
    formula: Formula = field(repr=False)
    options: Mapping[str, object] = field(default_factory=dict)

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.options.items())
        return f"{self.name}({given})"

    def __call__(self, grades: npt.ArrayLike) -> Array:
        """The relaxed pace P at grades of any shape, in ``unit`` per horizontal metre."""
        flat, shape = self._checked(grades)
        values = np.empty_like(flat)
        evaluate_paces(self.pace, flat, values)
        return values.reshape(shape)[()]

    def jets(self, grades: npt.ArrayLike) -> Array:
        """P, P' and P'' at grades (...), as (..., 3); at a kink those on its uphill side."""
        flat, shape = self._checked(grades)
        jets = np.empty((len(flat), 3))
        evaluate_jets(self.pace, flat, jets)
        return jets.reshape(*shape, 3)

    def raw(self, grades: npt.ArrayLike) -> Array:
        """The source's pace p at grades of any shape, per horizontal metre.

        Outside the range it is infinite: nobody goes there. Where ``beyond`` is ``"refuse"``, it is
        not known there, and InputError is raised.
        """
        flat, shape = _as_grades(grades)
        outside = (flat < self.grades[0]) | (flat > self.grades[1])
        if outside.any() and self.beyond == "refuse":
            self._refuse(float(flat[outside][0]))
        values = np.full_like(flat, np.inf)
        if not outside.all():
            values[~outside] = evaluate(self.formula, flat[~outside])
        return values.reshape(shape)[()]

    def intercepts(self, slopes: npt.ArrayLike) -> Array:
        """A(B) = min over m of P(m) - B m, for slopes B of any shape; -inf where there is none."""
        array = np.asarray(slopes)
        flat = as_array(array.reshape(-1), "slopes", shape=(None,))
        values = np.empty_like(flat)
        evaluate_intercepts(self.pace, flat, values)
        return values.reshape(array.shape)[()]

    def dual(self, tolerance: float = LINES_TOLERANCE) -> tuple[Array, Array]:
        """Lines A + B m that lie below P and together come close to it.

        tolerance : the largest distance below P, as a share of P(m) - ``gauge`` m, which is P where
            P is above 0.

        Returns B and A, (k,) each: B increases, A(B) is 0 or above, and P(m) is the max over B of
        A(B) + B m to within the tolerance.
        """
        require_positive(tolerance=tolerance)
        if tolerance == LINES_TOLERANCE:
            return self.pace.slopes.copy(), self.pace.intercepts.copy()
        return _lines(self.pace, self.gauge, tolerance)

    def reversed(self) -> TravelModel:
        """The model of the way back, with the pace p(-m)."""
        low, high = self.grades
        bridges = tuple((-b, -a) for a, b in self.bridges[::-1])
        return replace(
            self,
            name=self.name[:-9] if self.name.endswith(" reversed") else f"{self.name} reversed",
            grades=(-high, -low),
            critical=(-self.critical[1], -self.critical[0]),
            bridges=bridges,
            gauge=-self.gauge,
            pace=_reversed(self.pace),
            formula=partial(_opposite, self.formula),
        )

    def gauged(self) -> TravelModel:
        """The model with the pace P(m) - ``gauge`` m, above 0 everywhere; itself where P is.

        It has the same optimal paths where nothing multiplies the cost. A path from a to b costs
        less by gauge (z(b) - z(a)).
        """
        if self.gauge == 0.0:
            return self
        return replace(
            self,
            name=f"{self.name} gauged",
            gauge=0.0,
            pace=_tilted(self.pace, -self.gauge),
            formula=partial(_with_height, self.formula, -self.gauge),
        )

    def require_known(self, steepest: float) -> None:
        """Raise InputError where a map is steeper than what the pace was given for.

        A critical grade inside the range says what to do on all steeper ground.
        """
        for grade in (steepest, -steepest):
            self._check_one(grade)

    def _checked(self, grades: npt.ArrayLike) -> tuple[Array, tuple[int, ...]]:
        flat, shape = _as_grades(grades)
        if len(flat):
            self._check_one(float(flat.min()))
            self._check_one(float(flat.max()))
        return flat, shape

    def _check_one(self, grade: float) -> None:
        if self.beyond != "refuse":
            return
        low, high = self.grades
        if (grade < low and self.critical[0] == low) or (grade > high and self.critical[1] == high):
            self._refuse(grade)

    def _refuse(self, grade: float) -> None:
        low, high = self.grades
        raise InputError(
            f"{self.name} has no pace for the grade {grade:.4g}; it was given for {low:g} to "
            f"{high:g}: widen it, or pass beyond='switchbacks' to climb steeper ground in "
            "switchbacks at the ends of that range"
        )


def travel_model(
    name: str,
    formula: Formula,
    *,
    unit: str,
    source: str,
    grades: Grades = (-math.inf, math.inf),
    kinks: Iterable[float] = (),
    distance: Distance = "horizontal",
    beyond: Beyond = "switchbacks",
    options: Mapping[str, object] | None = None,
) -> TravelModel:
    """A travel model of a pace function.

    formula : from grades (k,) to paces (k,), in ``unit`` per metre.
    grades : the range where it is used, around 0. ``kinks`` : where it has kinks or jumps inside;
        others are found, to about 1e-10.
    distance : ``"slope"`` where the formula is per metre of slope distance.

    Raises InputError where the pace is not finite, too rough, or below 0 without a gauge that mends
    it.
    """
    require_choice(("horizontal", "slope"), distance=distance)
    require_choice(("switchbacks", "refuse"), beyond=beyond)
    if not (isinstance(unit, str) and unit.strip()):
        raise InputError(f"unit={unit!r} is not a unit; give one such as 's' or 'J'")
    low, high = _as_range(grades)
    pace = partial(_on_slope, formula) if distance == "slope" else formula
    window = -STEEPEST if math.isinf(low) else low, STEEPEST if math.isinf(high) else high
    # Pieces are as precise as their largest value, so that gentle grades have their own.
    inside = [m for m in (-1.0, 0.0, 1.0, *kinks) if window[0] < m < window[1]]
    tabulated = fit(pace, (*window, *inside))
    relaxed = relax(tabulated, (math.isinf(low), math.isinf(high)))
    arrays = _arrays(relaxed.pieces, relaxed.downhill, relaxed.uphill)
    gauge = _gauge(arrays)
    slopes, intercepts = _lines(arrays, gauge, LINES_TOLERANCE)
    return TravelModel(
        name=name,
        unit=unit,
        source=source,
        grades=(low, high),
        distance=distance,
        critical=(-relaxed.downhill.critical, relaxed.uphill.critical),
        bridges=tuple(relaxed.bridges),
        gauge=gauge,
        pace=arrays._replace(slopes=slopes, intercepts=intercepts),
        beyond=beyond,
        formula=pace,
        options=dict(options or {}),
    )


# Formulas are made of these rather than of closures, so that models can be sent to processes.


def _on_slope(formula: Formula, grades: Array) -> Array:
    return np.asarray(formula(grades)) * np.sqrt(1.0 + grades * grades)


def _opposite(formula: Formula, grades: Array) -> Array:
    return formula(-grades)


def _with_height(formula: Formula, slope: float, grades: Array) -> Array:
    return np.asarray(formula(grades)) + slope * grades


def _as_grades(grades: npt.ArrayLike) -> tuple[Array, tuple[int, ...]]:
    array = np.asarray(grades)
    return as_array(array.reshape(-1), "grades", shape=(None,)), array.shape


def _as_range(grades: Any) -> Grades:
    try:
        low, high = (float(grade) for grade in grades)
    except (TypeError, ValueError):
        raise InputError(
            f"grades={grades!r} is not a range; give the steepest descent and climb, such as "
            "(-0.5, 0.5)"
        ) from None
    if not low < 0 < high:
        raise InputError(
            f"grades=({low:g}, {high:g}) must reach from below 0 to above 0: level ground lies "
            "between a descent and a climb"
        )
    return low, high


# Arrays for kernels


def _arrays(pieces: Pieces, downhill: End, uphill: End) -> Pace:
    """The pace as arrays; the lower lines follow."""
    tails = np.array([[-downhill.slope, downhill.intercept], [uphill.slope, uphill.intercept]])
    return _guided(pieces, tails, _kinks(pieces, tails))


def _kinks(pieces: Pieces, tails: Array) -> Array:
    left, right = pieces.at_ends(1)
    jumps = np.append(left, tails[1, 0]) - np.append(tails[0, 0], right)
    level = float(np.abs(pieces.at_ends(0)[0]).max())
    return np.ascontiguousarray(pieces.knots[jumps > NO_KINK * level])


def _guided(pieces: Pieces, tails: Array, kinks: Array) -> Pace:
    """A pace with the index of its pieces, and no lines yet."""
    knots = np.ascontiguousarray(pieces.knots)
    cells = int(np.clip(4 * (len(knots) - 1), 16, 4096))
    cells_per_grade = cells / float(knots[-1] - knots[0])
    starts = knots[0] + np.arange(cells) / cells_per_grade
    guide = np.clip(np.searchsorted(knots, starts, side="right") - 1, 0, len(knots) - 2)
    return Pace(
        knots=knots,
        middles=pieces.middles,
        scales=1.0 / pieces.halves,
        coefficients=np.ascontiguousarray(pieces.coefficients),
        guide=guide.astype(np.int64),
        cells_per_grade=cells_per_grade,
        tails=tails,
        kinks=kinks,
        slopes=np.empty(0),
        intercepts=np.empty(0),
    )


def _reversed(pace: Pace) -> Pace:
    tails = np.ascontiguousarray(pace.tails[::-1] * (-1.0, 1.0))
    flipped = _guided(-Pieces(pace.knots, pace.coefficients), tails, -pace.kinks[::-1])
    return flipped._replace(
        kinks=np.ascontiguousarray(flipped.kinks),
        slopes=np.ascontiguousarray(-pace.slopes[::-1]),
        intercepts=np.ascontiguousarray(pace.intercepts[::-1]),
    )


def _tilted(pace: Pace, slope: float) -> Pace:
    tails = pace.tails + np.array([slope, 0.0])
    tilted = _guided(Pieces(pace.knots, pace.coefficients).tilted(slope), tails, pace.kinks)
    return tilted._replace(slopes=pace.slopes + slope, intercepts=pace.intercepts)


def _gauge(pace: Pace) -> float:
    """The slope of P at level ground where P is not above 0 everywhere, 0 where it is."""
    pieces = Pieces(pace.knots, pace.coefficients)
    level = _jets(pace, np.zeros(1))[0]
    falls = pace.tails[0, 0] > 0 or pace.tails[1, 0] < 0
    if not falls and pieces.lowest(0.0)[0] > 1e-12 * level[0]:
        return 0.0
    below = _jets(_reversed(pace), np.zeros(1))[0]
    return float(0.5 * (level[1] - below[1]))


# Lower lines


def _lines(pace: Pace, gauge: float, tolerance: float) -> tuple[Array, Array]:
    """Tangents of P, where two that follow each other meet within ``tolerance`` of it."""
    pieces = Pieces(pace.knots, pace.coefficients)
    left, right = pieces.at_ends(1)
    at_knots = np.concatenate(pieces.at_ends(0))
    slopes = np.concatenate([left, right])
    intercepts = at_knots - slopes * np.concatenate([pieces.knots[:-1], pieces.knots[1:]])
    lines = _in_order(np.column_stack([slopes, intercepts]), pace.tails)
    while True:
        slope, intercept = lines.T
        meeting = (intercept[:-1] - intercept[1:]) / np.diff(slope)
        jets = _jets(pace, meeting)
        apart = jets[:, 0] - (intercept[:-1] + slope[:-1] * meeting)
        far = apart > tolerance * (jets[:, 0] - gauge * meeting)
        if not far.any():
            return np.ascontiguousarray(slope), np.ascontiguousarray(intercept)
        new = np.column_stack([jets[far, 1], jets[far, 0] - jets[far, 1] * meeting[far]])
        added = _in_order(np.concatenate([lines, new]), pace.tails)
        if len(added) == len(lines):
            return np.ascontiguousarray(slope), np.ascontiguousarray(intercept)
        lines = added


def _in_order(lines: Array, tails: Array) -> Array:
    """Lines (k, 2) by slope, between the tails, without those that differ by rounding alone."""
    (first, last), inner = tails, lines[np.argsort(lines[:, 0])]
    spread = 1e-12 * max(abs(first[0]), abs(last[0]), 1e-300)
    inner = inner[(inner[:, 0] > first[0] + spread) & (inner[:, 0] < last[0] - spread)]
    if len(inner):
        inner = inner[np.append(True, np.diff(inner[:, 0]) > spread)]
    ends = [first, last] if last[0] > first[0] + spread else [first]
    return np.vstack([ends[0], inner, *ends[1:]])


def _jets(pace: Pace, grades: Array) -> Array:
    jets = np.empty((len(grades), 3))
    evaluate_jets(pace, np.ascontiguousarray(grades), jets)
    return jets
