"""A beam as another program would export it, and the arm that it is a link of."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse
from scipy.io import mmwrite
from spatial_cases import ALLOY, linkage
from spatial_oracle import Tree, element, section

from eigassign.mechanism import matrix_of, read_contents

FLAT = {"shape": "rectangle", "width": 0.02, "height": 0.03}
LENGTH, ELEMENTS = 0.6, 8
KEPT = {"planar": [0, 1, 5], "spatial": [0, 1, 2, 3, 4, 5]}


def exported(space: str) -> tuple[np.ndarray, np.ndarray]:
    """Free-free K, M of a beam as another program would write them."""
    n = 6 * (ELEMENTS + 1)
    K, M = np.zeros((n, n)), np.zeros((n, n))
    k, m = element(ALLOY, lambda _: section(FLAT), LENGTH / ELEMENTS, False)
    for e in range(ELEMENTS):
        at = slice(6 * e, 6 * e + 12)
        K[at, at] += k
        M[at, at] += m
    keep = np.add.outer(6 * np.arange(ELEMENTS + 1), KEPT[space]).ravel()
    return K[np.ix_(keep, keep)], M[np.ix_(keep, keep)]


def write(folder: Path, kind: str, K: np.ndarray, M: np.ndarray) -> tuple[str, str]:
    for name, A in (("K", K), ("M", M)):
        if kind == "npy":
            np.save(folder / f"{name}.npy", A)
        elif kind == "npz":
            sparse.save_npz(folder / f"{name}.npz", sparse.csr_array(A))
        else:
            mmwrite(folder / f"{name}.mtx", sparse.coo_array(A), symmetry="symmetric")
    return f"K.{kind}", f"M.{kind}"


def arm(space: str, links: Tree) -> Tree:
    """A beam, the link "part" hanging on it, and a tip mass on that."""
    turn = {} if space == "planar" else {"axis": [0.3, 1.0, -0.5]}
    return linkage(
        {"upper": {"length": 0.5, "elements": 2, "material": "m", "section": "s"}, **links},
        {
            "a": {"type": "revolute", "base": "ground", "follower": "upper.start", **turn},
            "b": {"type": "revolute", "base": "upper.end", "follower": "part.start"},
        },
        {"q1": {"joint": "a"}, "q2": {"joint": "b", "drive": {"stiffness": 4e3}}},
        section=FLAT,
        space=space,
        bodies={"tip": {"at": "part.end", "mass": 0.5}},
    )


def beam_arm(space: str) -> Tree:
    part = {"length": LENGTH, "elements": ELEMENTS, "material": "m", "section": "s"}
    return arm(space, {"part": part})


def part(space: str, files: tuple[str, str], **more: Any) -> Tree:
    width = len(KEPT[space])
    pad = [0.0] * (1 if space == "planar" else 2)
    last = width * ELEMENTS
    nodes = {
        "start": {"position": [0.0, *pad], "dofs": list(range(width))},
        "end": {"position": [LENGTH, *pad], "dofs": list(range(last, last + width))},
    }
    return {"type": "superelement", "stiffness": files[0], "mass": files[1], "nodes": nodes, **more}


def read_matrix(file: Path, key: str) -> sparse.csr_array:
    """The only matrix of a file; raises MechanismError at ``key``."""
    return matrix_of(read_contents(file, key), file, key).matrix
