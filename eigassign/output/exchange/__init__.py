"""A reduced model in files: HDF5 for ourselves, and for other programs NumPy, MATLAB, C99.

In reading order; each imports from those above it only:

    tape          programs as flat arrays of elementary operations
    numpy_reader  frequencies from such arrays; written beside a .npz file as it is
    c_source      the same arrays and a reader as C99
    files         a reduced model → its two files
    reduced_file  a reduced model in one HDF5 file, and back
"""
