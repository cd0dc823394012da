"""One configuration of the paper's arm solved by OpenSees and by Exudyn: the digits, and the time.

All have the paper's mesh (4 + 3 elements). OpenSees: `elasticBeamColumn` with consistent mass, the
elbow by `equalDOF`, LAPACK's full solver, for the others do not bear rigid-body modes. Exudyn: ANCF
cables (Hermite in both directions, so its axial motion is finer than ours), revolute joint,
eigenvalues on the null space of the constraints; without added masses, which its cable nodes do not
carry. Time is that of building the model at the pose and solving it, for that is what a new
configuration costs there.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
from collections.abc import Callable

import numpy as np

import eigassign as ea

Q0 = (1.817, 5.312)
LENGTHS, ELEMENTS, MODES = (0.6, 0.45), (4, 3), 3
AREA, INERTIA, YOUNG, DENSITY = 7.0632e-4, 3.97e-8, 69e9, 2689.998867


def nodes(q: tuple[float, float]) -> list[np.ndarray]:
    """Node positions of both links, (n + 1, 2) each."""
    base, found = np.zeros(2), []
    for length, count, angle in zip(LENGTHS, ELEMENTS, q, strict=True):
        direction = np.array([np.cos(angle), np.sin(angle)])
        found.append(base + np.linspace(0.0, length, count + 1)[:, None] * direction)
        base = found[-1][-1]
    return found


def opensees(q: tuple[float, float], masses: tuple[float, float]) -> np.ndarray:
    """Elastic frequencies in Hz."""
    import openseespy.opensees as ops

    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    ops.geomTransf("Linear", 1)
    tag = element = 0
    ends = []
    for line in nodes(q):
        first = tag + 1
        for x, y in line:
            tag += 1
            ops.node(tag, float(x), float(y))
        for k in range(first, tag):
            element += 1
            ops.element(
                "elasticBeamColumn", element, k, k + 1, AREA, YOUNG, INERTIA, 1,
                "-mass", AREA * DENSITY, "-cMass",
            )  # fmt: skip
        ends.append((first, tag))
    ops.fix(1, 1, 1, 0)
    ops.equalDOF(ends[0][1], ends[1][0], 1, 2)
    for (_, end), mass in zip(ends, masses, strict=True):
        if mass:
            ops.mass(end, mass, mass, 0.0)
    lam = np.array(ops.eigen("-fullGenLapack", MODES + 2))
    return np.sqrt(lam[2:]) / (2.0 * np.pi)


def exudyn(q: tuple[float, float]) -> np.ndarray:
    """The same without added masses."""
    import exudyn as exu
    from exudyn import beams
    from exudyn import utilities as util

    mbs = exu.SystemContainer().AddSystem()
    cable = util.Cable2D(
        physicsMassPerLength=AREA * DENSITY,
        physicsBendingStiffness=YOUNG * INERTIA,
        physicsAxialStiffness=YOUNG * AREA,
    )
    parts = [
        beams.GenerateStraightLineANCFCable2D(
            mbs, [*line[0], 0.0], [*line[-1], 0.0], len(line) - 1, cable,
            massProportionalLoad=[0, 0, 0],
            fixedConstraintsNode0=[1, 1, 0, 0] if first else [0] * 4,
        )
        for first, line in zip((True, False), nodes(q), strict=True)
    ]  # fmt: skip
    end, start = (
        mbs.AddMarker(util.MarkerNodePosition(nodeNumber=number))
        for number in (parts[0][0][-1], parts[1][0][0])
    )
    mbs.AddObject(util.RevoluteJoint2D(markerNumbers=[end, start]))
    mbs.Assemble()
    hz = mbs.ComputeODE2Eigenvalues(
        numberOfEigenvalues=MODES + 2, convert2Frequencies=True, ignoreAlgebraicEquations=False
    )[0]
    return np.sort(np.abs(hz))[2:]


def main() -> None:
    model = ea.load_case(common.CASES / "two_link.yaml").model()
    batch = np.tile(Q0, (1000, 1)) + np.linspace(-0.2, 0.2, 2000).reshape(-1, 2)
    jobs: dict[str, Callable[[], object]] = {
        "eigassign, one": lambda: model.frequencies(Q0, (0.125, 0.125), MODES),
        "eigassign, of 1000": lambda: model.frequencies(batch, (0.125, 0.125), MODES),
        "OpenSees": lambda: opensees(Q0, (0.125, 0.125)),
        "Exudyn": lambda: exudyn(Q0),
    }
    repeats = {"eigassign, one": 200, "eigassign, of 1000": 10, "OpenSees": 50, "Exudyn": 20}
    spent = common.medians(jobs, repeats)
    spent["eigassign, of 1000"] /= 1000
    loaded, bare = (model.frequencies(Q0, (m, m), MODES)[0] for m in (0.125, 0.0))
    theirs = {"OpenSees": opensees(Q0, (0.125, 0.125)) / loaded, "Exudyn": exudyn(Q0) / bare}
    rows = []
    for name, seconds in spent.items():
        ratio = theirs.get(name.split(",")[0])
        worst = "" if ratio is None else f"{np.abs(ratio - 1.0).max():.1e}"
        rows.append(
            {
                "program": name,
                "time a configuration": common.milliseconds(seconds),
                "ratio": seconds / spent["eigassign, of 1000"],
                "largest relative difference of three modes": worst,
            }
        )
    import exudyn as exu
    import openseespy.opensees as ops

    remarks = [f"OpenSees {ops.version()}, Exudyn {exu.config.Version()}"]
    common.report("peers_frequencies", "Exact frequencies of one configuration", rows, remarks)


if __name__ == "__main__":
    main()
