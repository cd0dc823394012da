"""Truncated power series over any lower set of multi-indices; knows no mechanics.

In reading order:

    multi_index  lower sets of multi-indices, and the table of products of two series over one
    algebra      what a formula is evaluated on: samples, or truncated series
    expression   formulas as they are written: sums of recorded atoms
    compiler     recorded atoms as a straight-line program, run in either algebra
    implicit     solutions p(a) of F(p, a) = 0, by continuation and by Newton's method on series
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "algebra": "Samples Tangents Truncated monomials polynomials",
        "compiler": "compile_program compile_table",
        "expression": "Expression Recorder Scalar cos derivative exp sin",
        "implicit": "ImplicitFunction",
        "multi_index": "LowerSet lower_set on_faces partially_linear total_degree",
    },
)
