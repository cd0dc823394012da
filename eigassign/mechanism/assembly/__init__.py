"""Assembly of eq. (1): K = Bᵀ k B and M = Bᵀ m B with B = [Q, N T], affine in scalar functions.

Read in this order; each imports only from those above it:

    pencil            K = Σ θ_j(q, y) K_j, M likewise: what all else evaluates; where entries go
    congruence        Bᵀ k B and Bᵀ m B of every link: where eq. (1) is formed
    node_motion       Q: the elastic motion of every node, loops of rigid links included; springs
    rigid_body_modes  free motions that no spring or weight resists, made columns of their own
    loads             the stiffness that loads add in a pose, above all the weight
    held              a node that does not move: the pencil of its antiresonances
    build             from a case to its pencil
    mode_shapes       the total mass; displacements of nodes and beams in [u; q̇]
    dynamics          what motion and loads add to eq. (1), at a pose
"""
