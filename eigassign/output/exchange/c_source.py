"""A reduced model as C99: its arrays as constants, and the reader of them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output.exchange.tape import SOLVE

Array = NDArray[Any]
_HERE = Path(__file__).parent
_TABLES = (
    "kinds", "numbers", "first_atom", "atoms", "weights", "functions", "first_output", "outputs",
    "first_known", "known", "to_program", "shift", "stiffness_terms", "stiffness", "mass_terms",
    "mass", "modes", "lower", "upper",
)  # fmt: skip


def c_source(tape: Mapping[str, Array], stem: str, about: str) -> tuple[str, str]:
    """Source and header of a `reduced_tape`; functions begin with ``stem`` as an identifier."""
    name = identifier(stem)
    words = {
        "NAME": name,
        "MACRO": name.upper(),
        "FILE": stem,
        "ABOUT": about,
        "N_Q": tape["n_q"][0],
        "N_Y": tape["n_y"][0],
        "N_MODES": len(tape["modes"]),
        "MODES": ", ".join(map(str, tape["modes"])),
        "SIZE": tape["size"][0],
        "ARRAYS": "\n\n".join([_sizes(tape), *(_table(n.upper(), tape[n]) for n in _TABLES)]),
    }

    def filled(template: str) -> str:
        text = (_HERE / template).read_text(encoding="ascii")
        return re.sub(r"@([A-Z_]+)@", lambda found: str(words[found[1]]), text)

    return filled("reader.c"), filled("reader.h")


def identifier(stem: str) -> str:
    """A name of C and MATLAB made from the name of a file."""
    name = re.sub(r"\W", "_", stem, flags=re.ASCII)
    return name if name[0].isalpha() else f"model_{name}"


def _sizes(tape: Mapping[str, Array]) -> str:
    """The sizes of the model, and of the largest arrays that its evaluation needs."""
    functions = tape["functions"]
    unknowns, equations, checks = functions[:, 4:].T
    arguments = np.diff(tape["first_atom"])
    systems = [1, *(unknowns**2)]
    systems += [n for n, kind in zip(arguments, tape["kinds"], strict=True) if kind >= SOLVE]
    sizes = {
        "N_Q": tape["n_q"][0],
        "N_Y": tape["n_y"][0],
        "N_Z": len(tape["shift"]),
        "N_THETA": 1 + tape["first_output"][1],
        "N_STIFFNESS": len(tape["stiffness_terms"]),
        "N_MASS": len(tape["mass_terms"]),
        "N_MODES": len(tape["modes"]),
        "SIZE": tape["size"][0],
        "RIGID": tape["rigid"][0],
        "N_ALL": tape["size"][0] + tape["rigid"][0],
        "MOST_VALUES": max(1, functions[:, 3].max()),
        "MOST_SYSTEM": max(systems),
        "MOST_UNKNOWNS": max(1, unknowns.max()),
        "MOST_ROWS": max(1, (equations + checks + equations * unknowns).max()),
    }
    return "enum {\n" + ",\n".join(f"    {name} = {n}" for name, n in sizes.items()) + "\n};"


def _table(name: str, values: Array) -> str:
    """A constant array; of no numbers one zero, as C has no empty ones."""
    whole = values.dtype.kind == "i"
    numbers = [str(int(v)) if whole else repr(float(v)) for v in values.ravel()] or ["0"]
    text = fill(", ".join(numbers), 96, break_long_words=False, break_on_hyphens=False)
    return f"static const {'int' if whole else 'double'} {name}[] = {{\n{text}\n}};"
