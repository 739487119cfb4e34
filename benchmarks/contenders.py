"""The planners whose trees are compared, and which of their options are tried."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

TERRAPATH, CPP, PYTHON = "terrapath", "ompl-cpp", "ompl-python"

Options = tuple[tuple[str, Any], ...]


@dataclass(frozen=True, kw_only=True)
class Contender:
    """A planner, and the choices of options, of which the best is taken."""

    label: str
    program: str
    planner: str
    choices: tuple[Options, ...]
    as_of: str = ""  # label of another contender, whose best options are taken instead
    late: bool = False  # ranked by the path in the end, not by the time until it is near
    few: bool = False  # runs with fewer seeds


def _own_choices(side: float, *, informed: bool) -> tuple[Options, ...]:
    return tuple(
        (("step", share * side), ("radius_factor", factor), ("informed", informed))
        for share in (1 / 12, 1 / 6, 1 / 3)
        for factor in (0.75, 1.0, 1.25, 1.5)
    )


def _ompl_choices(side: float) -> tuple[Options, ...]:
    """All near vertices, or as many as theory asks for, or half as many; with one or two steps."""
    near: tuple[Options, ...] = (
        (("use_k_nearest", 1), ("rewire_factor", 1.1)),
        (("use_k_nearest", 1), ("rewire_factor", 1.0 / 8.0)),
        (("use_k_nearest", 0), ("rewire_factor", 1.1)),
    )
    return tuple(
        (("range", share * side), *options) for share in (1 / 12, 1 / 6, 1 / 3) for options in near
    )


# OMPL's Informed RRT* does not switch this on, but it is faster with it: vertices that cannot
# improve the path, by the tree's own costs, are rejected.
_REJECTING: Options = (
    ("informed_sampling", 1),
    ("new_state_rejection", 1),
    ("use_admissible_heuristic", 0),
)

_BATCHES: tuple[Options, ...] = tuple(
    (("samples_per_batch", batch), ("rewire_factor", factor))
    for batch in (100, 400)
    for factor in (1.1, 0.75)
)

OURS, OURS_INFORMED = "RRT\\*-R", "RRT\\*-R, informed"
OURS_REFINED = "RRT\\*-R, informed and refined"
CPP_RRT, PYTHON_RRT = "OMPL RRT\\* in C++", "OMPL RRT\\* through Python"


def in_the_end(label: str) -> str:
    """The label of the contender with the options that are best in the end."""
    return f"{label}, best in the end"


def contenders(side: float) -> list[Contender]:
    """All planners that are compared. side : of the region, map units."""
    ompl = _ompl_choices(side)
    own = [
        Contender(
            label=label,
            program=TERRAPATH,
            planner="rrt-star-r",
            choices=_own_choices(side, informed=label == OURS_INFORMED),
        )
        for label in (OURS, OURS_INFORMED)
    ]
    own.append(
        Contender(
            label=OURS_REFINED,
            program=TERRAPATH,
            planner="rrt-star-r",
            choices=((("informed", True), ("refine", True)),),
        )
    )
    kinds = {
        "RRT\\*": ("rrt-star", ompl),
        "Informed RRT\\*": ("informed-rrt-star", ompl),
        "BIT\\*": ("bit-star", _BATCHES),
    }
    rejecting = tuple((*options, *_REJECTING) for options in ompl)
    cpp = [
        Contender(label=f"OMPL {label} in C++", program=CPP, planner=planner, choices=choices)
        for label, (planner, choices) in {
            **kinds,
            "RRT\\*, informed and rejecting": ("rrt-star", rejecting),
        }.items()
    ]
    # Not PRM*: it and its second thread wait for each other for ever (OMPL 2.0).
    python = [
        Contender(
            label=f"OMPL {label} through Python",
            program=PYTHON,
            planner=planner,
            choices=choices[:1],
            as_of=f"OMPL {label} in C++",
            few=label != "RRT\\*",
        )
        for label, (planner, choices) in kinds.items()
    ]
    late = [
        replace(contender, label=in_the_end(contender.label), late=True)
        for contender in (*own, *cpp)
        if contender.label in {OURS, CPP_RRT}
    ]
    return [*own, *cpp, *late, *python]
