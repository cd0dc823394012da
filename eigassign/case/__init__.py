"""YAML case file → validated, frozen, SI-valued objects; every error with file:line:column.

In reading order, each importing only from those above it:

    suggestions  wording of error messages: what was found, what was probably meant
    reader       bytes → plain data (a tree) with the line and column of every key
    units        quantities with units, dimension-checked → SI
    table        a table in a CSV file → columns in SI
    schema       what each key may hold: one pydantic model for each part of a case file
    rules        what keys must have in common, over the plain data; what looks like a slip
    canonical    content of a case → canonical YAML text that reads back equal
    case_file    the validated case as the rest of the program sees it
    values       other values of some keys
    loading      path or mapping → CaseFile, or all problems of the file at once
"""

from eigassign.case.case_file import CaseFile
from eigassign.case.loading import Unchecked, checked, from_mapping, load, parse, read
from eigassign.case.schema.design import Catalogue, Choices, DesignColumn, Tolerance
from eigassign.case.schema.document import json_schema
from eigassign.case.schema.joints import (
    CarriageJoint,
    FixedJoint,
    NutJoint,
    RevoluteJoint,
    ScrewJoint,
    UniversalJoint,
)
from eigassign.case.schema.links import FrameLink, RigidLink, SuperelementLink, Taper
from eigassign.case.schema.measurements import Measurement, MeasurementFile
from eigassign.case.schema.mechanism import Drive
from eigassign.case.schema.sections import BareSection, CircleSection, IProfileSection, TubeSection
from eigassign.case.schema.targets import (
    AtLeastTarget,
    AtMostTarget,
    FollowedMode,
    FrequencyFile,
    FrequencyProfile,
    FrequencyTarget,
    GapTarget,
    Harmonic,
    KeepOutTarget,
    Requirement,
    TargetForm,
)
from eigassign.case.schema.trajectory import (
    FileTrajectory,
    PointTrajectory,
    SampledTrajectory,
    TipTrajectory,
    TrajectoryForm,
)

__all__ = [
    "AtLeastTarget",
    "AtMostTarget",
    "BareSection",
    "CarriageJoint",
    "CaseFile",
    "Catalogue",
    "Choices",
    "CircleSection",
    "DesignColumn",
    "Drive",
    "FileTrajectory",
    "FixedJoint",
    "FollowedMode",
    "FrameLink",
    "FrequencyFile",
    "FrequencyProfile",
    "FrequencyTarget",
    "GapTarget",
    "Harmonic",
    "IProfileSection",
    "KeepOutTarget",
    "Measurement",
    "MeasurementFile",
    "NutJoint",
    "PointTrajectory",
    "Requirement",
    "RevoluteJoint",
    "RigidLink",
    "SampledTrajectory",
    "ScrewJoint",
    "SuperelementLink",
    "Taper",
    "TargetForm",
    "TipTrajectory",
    "Tolerance",
    "TrajectoryForm",
    "TubeSection",
    "Unchecked",
    "UniversalJoint",
    "checked",
    "from_mapping",
    "json_schema",
    "load",
    "parse",
    "read",
]
