"""Kinematics of the equivalent rigid-link system (ERLS), on numbers and expressions alike.

Read in this order; each imports only from those above it:

    joints        rotations; rotation, translation and motion subspace A of each type of joint
    topology      spanning tree, loop-closing joints, freedoms; coordinates, s = A q + b
    parameters    numbers of the mechanism, node positions; what riders and properties may be
    forward       twists of the links, from the ground to the tips; their frames in the world
    loop_closure  passive freedoms p(q, y) and their rates P q̇; the assembly branch
"""
