"""From the case to the affine ERLS pencil K, M of eq. (1), and from paths to trajectories q(t).

Read in this order; each imports only from those above it:

    kinematics          the rigid links: tree, joints, twists T(q, y), closed loops
    elements            each link as a finite-element mesh in its own frame: k(y), m(y), N(y)
    assembly            K = Bᵀ k B and M = Bᵀ m B with B = [Q, N T], affine in scalar functions
    inverse_kinematics  the coordinates q along a path of the tip
    trajectory          q(t) from samples, files, points or tip paths
"""
