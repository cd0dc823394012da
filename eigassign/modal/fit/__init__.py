"""Fits: a polynomial in place of eigensolves, to a stated accuracy over a stated region.

Reading order:

    path     a trajectory as axes v ∈ [−1, 1] between its corners, with nodes
    region   a trajectory or a box of q, times a box of y, as axes
    meeting  what is missed where modes meet between the nodes
    source   where a fit takes frequencies from: a model, a reduced model or an expansion
    fit      the polynomial that answers in its place
"""
