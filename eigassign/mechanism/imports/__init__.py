"""Parts from other programs: their matrices, their nodes and their units.

Read in this order; each imports only from those above it:

    matlab_child  MATLAB's .mat by SciPy and h5py, in a process of its own
    entries       what readers share; Matrix Market, NumPy, tables, what that process sends
    op4           Nastran's OUTPUT4, text and binary
    programs      Nastran, Abaqus, CalculiX, Ansys: matrices, freedoms of rows, nodes
    parts         K, M, rows and places of a link's nodes, in SI, from files told by content
"""
