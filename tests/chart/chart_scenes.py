"""A small effort, so that a whole chart takes a moment."""

from __future__ import annotations

from eigassign.chart.effort import Effort
from eigassign.chart.timing import Patience

TINY = Effort(
    random_points=30,
    designs=2,
    samples_per_design=9,
    orders=(1, 2, 4),
    half_orders=(1, 2),
    expansion_points=(1, 3),
    nodes=(2, 4),
    stations=(5,),
    accuracies=(1e-4,),
    training=(27,),
    reference_s=1e9,
    training_s=1e9,
    factors=(0.5, 1.0, 2.0),
    patience=Patience(rounds=1, seconds=0.0, long_s=60.0),
    objectives=40,
    searched_s=1e9,
)
