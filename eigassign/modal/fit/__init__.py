"""Fits: a polynomial in place of eigensolves, to a stated accuracy over a stated region.

Reading order:

    domain  the region: a trajectory or a box of q, times a box of y, as axes v ∈ [−1, 1]
    fit     what is asked of the model, and the polynomial that answers in its place
"""
