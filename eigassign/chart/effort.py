"""How much a chart tries: the points of the question, the sizes of the methods, and time limits."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from eigassign.chart.timing import Patience

LARGE = 1000  # n_dof from which a quick chart leaves out what takes long there


@dataclass(frozen=True)
class Effort:
    """The defaults are those of a chart without ``--quick``."""

    quick: bool = False
    # the points at which methods are compared
    random_points: int = 600
    designs: int = 15
    samples_per_design: int = 152
    reference_s: float = 120.0  # for the exact answers
    # eigassign's methods
    orders: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12)
    coefficients: int = 5000  # largest set that is expanded
    half_orders: tuple[int, ...] = (0, 1, 2, 3)
    expansion_points: tuple[int, ...] = (1, 3, 5)
    fitted: tuple[tuple[int, int], ...] = ((1, 3), (2, 1))  # half order, points of reduced models
    accuracies: tuple[float, ...] = (
        1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8, 1e-9,
    )  # asked of fits  # fmt: skip
    choosing_s: float = 20.0  # after a choice by `order: auto` that takes longer no other is made
    # the others
    nodes: tuple[int, ...] = (2, 3, 4, 5, 6, 7, 9, 11)  # of a grid, along each axis
    stations: tuple[int, ...] = (3, 5, 9, 17, 33, 65)
    training: tuple[int, ...] = (27, 64, 125, 343)  # points of surrogates
    training_s: float = 60.0  # for the exact solves of one method's training
    one_by_one: int = 200  # points at which exact solvers are tried that take one at a time
    most_dense: int = 2500  # n_dof up to which SciPy's dense solver is tried
    # meshes and designs
    factors: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
    most_dof: int = 40_000  # of a refined mesh
    objectives: int = 600  # exact evaluations of the objective in a search
    searched_s: float = 60.0  # exact solves of one search may take about this long
    patience: Patience = field(default_factory=Patience)


QUICK = Effort(
    quick=True,
    random_points=150,
    designs=9,
    reference_s=3.0,
    orders=(1, 2, 3, 4, 6, 8),
    coefficients=1000,
    expansion_points=(1, 3),
    accuracies=(1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8),
    choosing_s=1.0,
    nodes=(3, 5, 7),
    stations=(5, 17),
    training=(27, 125),
    training_s=1.0,
    one_by_one=50,
    most_dense=300,
    factors=(0.5, 1.0, 2.0, 4.0),
    most_dof=2500,
    objectives=60,
    searched_s=1.0,
    patience=Patience(rounds=3, seconds=0.0, long_s=0.06),
)


def suited(effort: Effort, n_dof: int) -> Effort:
    """The effort for a model of this size: a quick chart leaves out what takes long.

    A fit of a reduced model costs its error estimate at every node: exact solves of small models
    cost less.
    """
    if not effort.quick:
        return effort
    if n_dof <= LARGE:
        return replace(effort, fitted=())
    return replace(effort, orders=(1, 2, 3, 4), half_orders=(1, 2), expansion_points=(1,))
