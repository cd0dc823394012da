"""What moves of the shipped SCARA leave, against an integration of the whole by Exudyn.

    pip install exudyn==1.13.6
    python benchmarks/moves_in_exudyn.py

Exudyn has nonlinear beams that bend, stretch and shear, rigid bodies, and Newmark's method with
constraints of index 2. Motors follow the quintic and turn the joints by springs. All is built here
from numbers of the case and of the design: a rotor turns with its joint, as the case means it, and
κ of a box is Cowper's of thin walls for ν = 0. Nothing of our matrices is used.

Without damping nothing has to be chosen. The damping of the case is one ratio ζ of all modes; in
Exudyn there are dashpots beside the springs: of the deflections of both joints in the two lowest
modes, δ = B Φ, by Exudyn's own Φ and ω over the angle of the elbow,

    τ = −C_d (B ẋ − q̇),   C_d = δ⁻ᵀ diag(2ζω) δ⁻¹ .

That holds for these two; those from 190 Hz on are damped otherwise.

A tenth of the path, its last, as a move of its own tells what goes with the size of a move from
what is wrong in any. "Finer" has half the time step and twice the elements.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import sys
from itertools import product
from typing import Any

import numpy as np
import yaml
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

try:
    import exudyn as exu
    from exudyn import beams
    from exudyn import utilities as util
except ImportError:
    sys.exit("This benchmark needs Exudyn: pip install exudyn==1.13.6")

import eigassign as ea
from eigassign.modal import Damping, move

STEP, ELEMENTS, PERIODS = 1e-4, 2, 20  # s; quadratic ones of a link; of the lowest mode
SHARES = np.linspace(0.7, 1.3, 7)  # of a design's own motion time
OTHERS = {"soft shoulder": (15e3, 24e3, 0.05, 0.3), "soft elbow": (45e3, 8e3, 0.08, 0.2)}
B = np.zeros((2, 9))  # deflections of both joints by hub, end of the upper arm, start of the other
B[0, 2] = B[1, 8] = 1.0
B[1, 5] = -1.0


def case_of(share: float) -> ea.Case:
    """The shipped case with the last share of its path."""
    data: dict[str, Any] = yaml.safe_load((common.CASES / "scara.yaml").read_text())
    start, end = np.array(ea.load_case(data).file.trajectory.points)
    data["trajectory"]["points"] = [(end - share * (end - start)).tolist(), end.tolist()]
    return ea.load_case(data)


def ours(case: ea.Case, y: np.ndarray, durations: np.ndarray, zeta: float) -> np.ndarray:
    path = case.trajectories[0].trajectory
    own = move(case.model(), path, {"forearm.end": np.eye(2).tolist()}, Damping((zeta,)))
    return own.at(np.append(y[:3], np.ptp(path.time_s))).residuals(durations)[:, 0]


def theirs(
    case: ea.Case, y: np.ndarray, durations: np.ndarray, zeta: float, finer: int = 1
) -> np.ndarray:
    file = case.file
    start, end = np.array(file.trajectory.points)
    angles = np.linspace(start[1], end[1], 5)
    found = [Scara(file, y, np.array([0.0, q])).modes() for q in angles]
    lost = [np.linalg.inv(d).T @ np.diag(2.0 * zeta * w) @ np.linalg.inv(d) for w, d in found]
    after = PERIODS * 2.0 * np.pi / found[-1][0][0]
    C, h = CubicSpline(angles, lost), STEP / finer
    ways = []
    for T in durations:
        own = Scara(file, y, start, finer * ELEMENTS, end - start, T, C if zeta else None)
        steps = np.ceil(T / h)
        t, x, z, _ = own.run(T / steps, int(steps + after / h)).T
        a, b = np.cumsum(end)
        (r, s) = own.lengths
        off = np.hypot(x - r * np.cos(a) - s * np.cos(b), z - r * np.sin(a) - s * np.sin(b))
        ways.append(off[t > T - 0.5 * h].max())
    return np.array(ways)


def beam(data: Any, section: Any, height: float) -> Any:
    """A quadratic beam of a box of even walls, by numbers of the case."""
    E, w, h, t = data.youngs_modulus, section.width, height, section.thickness
    p, q, n = w - 2.0 * t, h - 2.0 * t, (w - t) / (h - t)
    area, inertia = w * h - p * q, (w * h**3 - p * q**3) / 12.0
    kappa = 10.0 * (1.0 + 3.0 * n) ** 2
    kappa /= 12.0 + 72.0 * n + 150.0 * n**2 + 90.0 * n**3 + 30.0 * n**3 * (1.0 + n)
    return util.ObjectBeamGeometricallyExact2D(
        nodeNumbers=[-1] * 3,
        massPerLength=data.density * area,
        crossSectionInertia=data.density * inertia,
        bendingStiffness=E * inertia,
        axialStiffness=E * area,
        shearStiffness=kappa * E / (2.0 * (1.0 + data.poissons_ratio)) * area,
    )


class Scara:
    """The mechanism in Exudyn at a pose (2,), whose motors turn by ``way`` (2,) in T seconds."""

    def __init__(
        self, file: Any, y: np.ndarray, pose: np.ndarray, elements: int = ELEMENTS,
        way: np.ndarray | None = None, T: float = 1.0, C: CubicSpline | None = None,
    ) -> None:  # fmt: skip
        parts = file.mechanism
        heights = {"upper": y[2], "fore": parts.sections["fore"].height}
        links = [parts.links[name] for name in ("upper_arm", "forearm")]
        self.lengths = [link.length for link in links]
        self.mbs = mbs = exu.SystemContainer().AddSystem()
        place, self.ends = np.zeros(3), []
        for link, angle in zip(links, np.cumsum(pose), strict=True):
            start, place = place, place + link.length * np.array([np.cos(angle), np.sin(angle), 0])
            own = parts.sections[link.section]
            own = beam(parts.materials[link.material], own, heights[link.section])
            line = beams.GenerateBeamElementsAlongLine(mbs, start, place, elements, own)
            self.ends += [line["nodes"][0], line["nodes"][-1]]
        for name, node in zip(("elbow_motor", "quill"), self.ends[1::2], strict=True):
            body = parts.bodies[name]
            own = {"mass": body.mass, "inertia": body.inertia}
            mbs.AddObject(util.ObjectRigidBody2D(nodeNumber=node, **own))
        ground = mbs.AddNode(util.NodePointGround())
        for pair in ((ground, self.ends[0]), self.ends[1:3]):
            for axis in (0, 1):
                marks = [util.MarkerNodeCoordinate(nodeNumber=n, coordinate=axis) for n in pair]
                marks = [mbs.AddMarker(mark) for mark in marks]
                mbs.AddObject(util.ObjectConnectorCoordinate(markerNumbers=marks))
        drives = [file.coordinates[name].drive for name in ("q1", "q2")]
        rotors, K = np.diag([d.motor_inertia * d.ratio**2 for d in drives]), np.diag(y[:2])

        def torque(_: Any, t: float, __: int, x: Any, v: Any) -> np.ndarray:
            s = min(t / T, 1.0)
            found = K @ way * (s**3 * (10.0 - 15.0 * s + 6.0 * s * s))
            if C is not None:
                rate = way * (30.0 * s * s * (1.0 - s) ** 2 / T)
                found = found - C(pose[1] + B[1] @ np.array(x)) @ (B @ np.array(v) - rate)
            return B.T @ found

        joints = {"massMatrix": B.T @ rotors @ B, "stiffnessMatrix": B.T @ K @ B}
        joints |= {} if way is None else {"forceUserFunction": torque}
        mbs.AddObject(util.ObjectGenericODE2(nodeNumbers=self.ends[:3], **joints))
        place = exu.OutputVariableType.Position
        seen = util.SensorNode(nodeNumber=self.ends[3], outputVariableType=place, storeInternal=1)
        self.tip = mbs.AddSensor(seen)
        mbs.Assemble()

    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """ω of the two lowest and the deflections of both joints in them, for ΦᵀMΦ = I."""
        M, K, _ = self.mbs.ComputeLinearizedSystem()
        hub, end, start, _ = (3 * node + np.arange(3) for node in self.ends)
        free = np.eye(len(M))
        free[start[:2]] = free[end[:2]]
        free = np.delete(free, [*hub[:2], *start[:2]], axis=1)
        lam, phi = eigh(free.T @ K @ free, free.T @ M @ free, subset_by_index=(0, 1))
        return np.sqrt(lam), B @ (free @ phi)[np.concatenate([hub, end, start])]

    def run(self, h: float, steps: int) -> np.ndarray:
        """Instants and places of the tip (steps + 1, 4)."""
        settings = exu.SimulationSettings()
        solver = settings.timeIntegration
        solver.numberOfSteps, solver.endTime = steps, steps * h
        solver.newton.useModifiedNewton = True
        solver.newton.absoluteTolerance = 1e-6  # the residual to 1e-5; by 1e-10 rounding stalls it
        solver.generalizedAlpha.useNewmark = solver.generalizedAlpha.useIndex2Constraints = True
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = h
        settings.linearSolverType = exu.LinearSolverType.EigenSparse
        self.mbs.SolveDynamic(settings)
        return self.mbs.GetSensorStoredData(self.tip)


def main() -> None:
    exu.config.suppressWarnings = True
    whole, tenth = case_of(1.0), case_of(0.1)
    designs = {
        "initial": whole.initial_design,
        "optimum": list(ea.assign(whole).design.values()),
    }
    rows = []
    for (name, given), zeta in product((designs | OTHERS).items(), (0.0, whole.file.damping)):
        y = np.array(given)
        T = y[3] * SHARES
        own, exact, finer = (
            ours(whole, y, T, zeta), theirs(whole, y, T, zeta), theirs(whole, y, T, zeta, 2)
        )  # fmt: skip
        few, small = ours(tenth, y, T, zeta), theirs(tenth, y, T, zeta)
        rows.append(
            {
                "design": name,
                "k1, k2, h1": " ".join(f"{v:.4g}" for v in y[:3]),
                "damping": f"{100.0 * zeta:g} %",
                "motion times, s": _row(T, 3),
                "ours, mm": _row(1e3 * own, 3),
                "Exudyn, mm": _row(1e3 * exact, 3),
                "difference, % of the largest": _row(100.0 * (own - exact) / exact.max(), 1),
                "worst": _share(own - exact, exact),
                "of a tenth of the path": _share(few - small, small),
                "Exudyn, finer": _share(finer - exact, exact),
            }
        )
    remarks = [
        "residual of `forearm.end`, mm, the largest of 20 periods; worst, of a tenth and finer: of "
        "the largest of the row",
        "k in N m/rad, h in m; wanted: 3 %",
        f"Exudyn {exu.config.Version()}; {1e3 * STEP:g} ms, {ELEMENTS} quadratic elements of a "
        "link; `python benchmarks/moves_in_exudyn.py`",
    ]
    common.report("moves_in_exudyn", "What moves leave, against Exudyn", rows, remarks)


def _row(values: np.ndarray, digits: int) -> str:
    return " ".join(f"{v:.{digits}f}" for v in values)


def _share(off: np.ndarray, of: np.ndarray) -> str:
    return f"{100.0 * np.abs(off).max() / of.max():.2f} %"


if __name__ == "__main__":
    main()
