"""Fits: a polynomial in place of eigensolves, to a stated accuracy over a stated region.

Reading order:

    interpolation  nodes, coefficients and error of a polynomial on one axis or several,
                   and what it misses where modes meet
    path           a trajectory, cut at its corners
    region         a trajectory or a box of q, times a box of y, as axes
    source         where a fit takes frequencies from: a model, a reduced model or an expansion
    fit            the polynomial that answers in its place
"""
