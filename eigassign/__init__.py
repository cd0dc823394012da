"""Assign the natural frequencies of moving, flexible mechanisms along their trajectory.

In a session, with ``dir(ea)`` for what else there is (docs/python.md):

>>> import eigassign as ea
>>> case = ea.load_case("cases/two_link.yaml")  # or a mapping; case.plot() draws it
>>> case.model().frequencies(case.trajectory.q, case.initial_design)  # exact, Hz, (n, 3)
>>> result = ea.assign(case)  # .design, .exact_hz, .plot(), .to_dict() for pandas

Data flows one way: a module imports only from those above it in this list, which is also the order
in which to read. The way of a case is `case`, `mechanism`, `modal`, `assignment`, `study`; it is
one function, `eigassign.pipeline.run.solve_case`.

    _version       the version
    errors         every error raised on purpose, and its exit code
    files          reading files that anybody may have put there, within limits
    arrays         the types of NumPy's arrays
    brief          short reprs of objects that hold arrays
    facts          what is said of a fact once: words, unit, digits; numbers as people read them
    faces          what a package shows to those outside, loaded at first use
    process        the process around a command: errors on stderr, signals, streams, threads
    series         truncated power series and expressions that are evaluated on them
    case           a case file: schema, units, rules, every problem with its line
    mechanism      links, joints, kinematics: K and M of eq. (1), and the trajectory
    modal          exact modes, expansions of eqs. (4)–(9), reduced models
    assignment     the quadratic program of eqs. (13)–(14)
    study          one case: choices left to auto, optimal design, comparison with exact
    chart          time against accuracy of every method on one case
    output         results.json, report, figures, tables, run folder, cache
    pipeline       one case from its file to its folder
    api            the functions for notebooks
    batch          many cases in parallel
    cli            the command line
    __main__       python -m eigassign
"""

from __future__ import annotations

from eigassign._version import __version__

TYPE_CHECKING = False  # `typing` and `errors` take 30 ms in which `__main__` catches no Ctrl-C yet
if TYPE_CHECKING:
    from typing import Any

    from eigassign.api import (
        Case,
        assign,
        expand,
        load_case,
        reduce,
        response,
        update,
        urdf_mapping,
    )
    from eigassign.errors import CaseError, EigassignError

__all__ = [
    "Case",
    "CaseError",
    "EigassignError",
    "__version__",
    "assign",
    "expand",
    "load_case",
    "reduce",
    "response",
    "update",
    "urdf_mapping",
]


def __getattr__(name: str) -> Any:
    """Import the Python face on first use, so that ``eigassign --help`` is instant."""
    if name in __all__:
        from eigassign import api, errors

        return getattr(errors if name in vars(errors) else api, name)
    raise AttributeError(f"module 'eigassign' has no attribute {name!r}")


def __dir__() -> list[str]:
    """The public names for completion, whether `__getattr__` has loaded them yet or not."""
    return sorted(__all__)
