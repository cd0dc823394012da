"""All links in numbers at a pose: what their motion and the loads on them add to eq. (1).

Read in this order:

    velocity_terms  the velocity terms of eq. (1) that the method neglects
    inertia_forces  what the rigid motion does to the unknowns
    under_load      the stiffness under any loads: of weight, motion and modes
"""
