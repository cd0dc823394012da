"""Taylor coefficients of eigenvalues and eigenvectors about one point (eqs. (4)-(6)).

In reading order:

    bordered   the pencil's power series; the bordered system of every order, factored once
    rayleigh   2m + 1: eigenvalues to order p from eigenvectors to half of it; projections
    recursion  eigenvector coefficients of a cluster of modes, degree by degree, about one x0
"""
