"""YAML case file → validated, frozen, SI-valued objects; every error with file:line:column.

In reading order, each importing only from those above it:

    reader     bytes → plain data (a tree) with lines and columns; other values of some keys; words
    units      quantities with units, dimension-checked → SI
    table      a table in a CSV file → columns in SI
    schema     what each key may hold: one pydantic model for each part of a case file
    rules      what keys must have in common once each is right; what looks like a slip
    case_file  path or mapping → the validated case, or all problems of the file; its canonical YAML
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "case_file": "CaseFile checked from_mapping load parse plain read to_yaml",
        "reader": "key_path read_yaml",
        "schema.design": "Tolerance",
        "schema.document": "json_schema",
        "schema.mechanism": "FREEDOMS",
        "schema.parts": "Quantity",
        "schema.study": "Measurement MeasurementFile",
        "schema.trajectory": "FileTrajectory PointTrajectory SampledTrajectory TipTrajectory",
        "units": "DIMENSIONS SI Dimension Given QuantityError handy_unit read_quantity",
    },
)
