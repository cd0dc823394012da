"""The stiffness K_g that loads add in a pose: K_g = Bᵀ k_σ(n) B + Σ_a p_a ∂²w_a/∂x².

The drives hold the pose; n are the internal forces that the loads cause there. They are described
once: the weight has loads that are functions of (q, y), any others are variables (`dynamics`).
Read in this order; each imports only from those above it:

    statics       a mechanism that loads act on; the wrenches through its joints, loops included
    second_order  k_σ of beams and parts from what acts on them; arms, joints, springs
    weight        the weight as loads, the beams it stresses; forces that hang on stiffnesses
"""
