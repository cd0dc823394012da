"""The stiffness K_g that the weight adds in a pose: K_g = Bᵀ k_σ(n) B + Σ_a p_a ∂²w_a/∂x².

The drives hold the pose; n are the internal forces that the weight causes there. Read in this
order; each imports only from those above it:

    beam_stress  k_σ of a beam element from its end forces and its own weight
    imported     k_σ of a part that is known by its matrices alone
    elastic      forces that hang on stiffnesses: redundant loops and springs
    statics      the wrenches through the joints, explicit for trees, one small solve for loops
    curvature    levers and joints: where displacements are of second order in the motion
    weight       all terms, added to the entries of K
"""
