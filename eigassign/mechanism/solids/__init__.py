"""Meshes of solid parts: what files hold, the elements' matrices, and the nodes for surfaces.

Read in this order; each imports only from those above it:

    elements   stiffness and mass of tetrahedra of 4 and 10 nodes and hexahedra of 20
    mesh_file  a mesh from a file of gmsh, Abaqus, CalculiX or Nastran, within limits
    part       K, M and rigid motion of a part; nodes for surfaces; how far its mesh errs
"""
