"""Parts from other programs: their matrices, their nodes and their units.

Read in this order; each imports only from those above it:

    matlab_child  MATLAB's .mat by SciPy, in a process of its own
    entries       what readers share; NumPy, what that process sends
    programs      Nastran, Abaqus, CalculiX, Ansys: matrices, freedoms of rows, nodes
    parts         K, M, rows and places of a link's nodes, in SI, from files told by content
"""
