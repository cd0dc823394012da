"""Frequencies of the affine pencil: exact, by Taylor expansion, reduced, and fitted.

In reading order:

    arguments    samples of (q, y), modes and orders as callers give them, checked
    exact        exact elastic modes
    slopes       slopes of exact eigenvalues in coordinates and design
    projection   the pencil's terms projected on a basis
    taylor       Taylor coefficients of eigenvalues and eigenvectors (eqs. (4)-(6))
    reduced      Ritz on the Taylor vectors, with an error estimate
    expansion    the Taylor polynomial of eigenvalues (eqs. (7)-(9)), judged by a reduced model
    confirmation  whether stored coefficients are those of a model
    storage      expansions and reduced models as plain arrays
    truncation   what the reduction of links leaves out, bounded
    discretisation  what a mesh leaves out, bounded
    model        the model of a case, as notebooks meet it
    slow_motion  how much the neglected velocity terms would move the frequencies
    adaptive     the least mesh, order and reduction that meet an accuracy
    fit          polynomials through exact frequencies, with an error estimate
"""
