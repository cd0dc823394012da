"""The reduced model: Ritz on Taylor vectors, with an estimate of its own error.

It takes Taylor vectors as a basis and knows nothing of expansions. In reading order:

    pencil            the pencil projected on a basis, and its Ritz pairs
    basis             Taylor vectors, guards and probes, made K-orthonormal
    residual          the norm of a Ritz pair's residual by small arrays only
    added_mass        how far added mass may bring down modes beside the basis
    design_stiffness  how far a design softens each part
    spans             how far a rider on a beam may bring down modes beside the basis
    error_estimate    from residuals to the error in frequency, and when an answer is refused
    model             frequencies and their error estimate
    compression       a smaller basis for a known region
    reduce            the one function that builds it all
"""
