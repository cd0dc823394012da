"""Cases of some size: a spatial arm, and a scene of 10⁴ degrees of freedom."""

from __future__ import annotations

from typing import Any

import arms
import numpy as np
import yaml
from common import CASES


def six() -> str:
    """The shipped spatial arm of six joints."""
    return (CASES / "arm_6r.yaml").read_text(encoding="utf-8")


def large(branches: int = 33) -> str:
    """A trunk with short chains: 10⁴ degrees of freedom, three locked joints, two masses."""
    data = arms.tree(branches, links=3, elements=34)
    data["design"] = {name: part for name, part in data["design"].items() if name in ("m1", "m3")}
    start = np.array([0.0, 0.7, -0.8, 0.5])
    return _with_motion(data, start, start + np.array([0.3, 0.3, -0.3, 0.3]), 21, 1)


def _with_motion(
    data: dict[str, Any], start: np.ndarray, end: np.ndarray, samples: int, mode: int
) -> str:
    """From start to end at rest, all joints together; the mode is wanted where it is now."""
    tau = np.linspace(0.0, 1.0, samples)
    s = 10 * tau**3 - 15 * tau**4 + 6 * tau**5
    q = start + s[:, None] * (end - start)
    data["trajectory"] = {"q": [[float(v) for v in row] for row in q], "duration": 1.0}
    data["expansion"] = {"order": 4, "modes": [mode]}
    hz = _middle_frequency({**data, "targets": []}, mode)
    data["targets"] = [{"mode": mode, "frequency": round(hz, 3)}]
    return yaml.safe_dump(data, sort_keys=False)


def _middle_frequency(data: dict[str, Any], mode: int) -> float:
    case = arms.case_of({k: v for k, v in data.items() if k != "targets"})
    q = case.trajectory.q[len(case.trajectory.q) // 2]
    y = [0.5 * (p.min + p.max) for p in case.file.design.parameters.values()]
    return float(case.model().frequencies(q, y, mode)[0, mode - 1])
