"""Taylor coefficients of eigenvalues and eigenvectors about one point (eqs. (4)-(6)).

The first four modules are the recursion; they know the pencil's series and nothing of variables.
In reading order:

    bordered   the pencil's power series; the bordered system of every order, factored once
    recursion  eigenvector coefficients of a cluster of modes, degree by degree, about one x0
    rayleigh   2m + 1: eigenvalues to order p from eigenvectors to half of it; projections
"""
