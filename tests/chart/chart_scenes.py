"""A small effort, so that a whole chart takes a moment."""

from eigassign.chart import Effort

TINY = Effort(
    random_points=30,
    samples_per_design=9,
    orders=(1, 2, 4),
    half_orders=(1, 2),
    expansion_points=(1, 3),
    factors=(0.5, 1.0, 2.0),
    repeats=1,
)
