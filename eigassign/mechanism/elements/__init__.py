"""The links as finite-element meshes in their own frames, where they do not depend on q.

Read in this order; each imports only from those above it:

    sections       cross-sections, and stiffnesses and masses of a beam along each element
    beam           stiffness and consistent mass of a beam element; its shape functions
    links          a link as a mesh: k(y), m(y), nodes, rigid motion N(y), bodies; those of beams
    craig_bampton  factors of sparse matrices; fixed-interface modes instead of interior dofs
    solid_stress   k_σ of a solid part for each load on its nodes
    superelement   links from another program, or from the mesh of a solid part; what a part is
"""
