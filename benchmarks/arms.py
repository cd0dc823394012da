"""Mechanisms of any size, written as case files and built by the public path: case → model."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

import eigassign as ea

STEEL = {"youngs_modulus": 2.1e11, "density": 7850.0}
CARBON = {"youngs_modulus": 2.1e11, "density": 1600.0}


def case_of(data: Mapping[str, Any]) -> ea.Case:
    """The case that ``data`` describes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.yaml"
        path.write_text(yaml.safe_dump(dict(data), sort_keys=False), encoding="utf-8")
        return ea.load_case(path)


def serial_arm(elements: int, design: Mapping[str, Any]) -> dict[str, Any]:
    """A planar arm of six links, all joints free; ``design`` as in a case file."""
    names = [f"link{k}" for k in range(6)]
    bases = ["ground", *(f"{name}.end" for name in names[:-1])]
    return {
        "title": "Arm of six links",
        "mechanism": {
            "space": "planar",
            "materials": {"steel": STEEL},
            "sections": {
                f"rod{k}": {"shape": "circle", "diameter": 0.05 - 0.005 * k} for k in range(6)
            },
            "links": {
                name: {
                    "length": 0.6 - 0.05 * k,
                    "material": "steel",
                    "section": f"rod{k}",
                    "elements": elements,
                }
                for k, name in enumerate(names)
            },
            "joints": {
                f"joint{k}": {"type": "revolute", "base": base, "follower": f"{name}.start"}
                for k, (base, name) in enumerate(zip(bases, names, strict=True))
            },
            "bodies": {f"mass{k}": {"at": f"{n}.end", "mass": 0.5} for k, n in enumerate(names)},
        },
        "coordinates": {f"q{k}": {"joint": f"joint{k}"} for k in range(6)},
        "design": dict(design),
    }


def tree(branches: int, links: int = 3, elements: int = 34) -> dict[str, Any]:
    """A trunk of four links on revolute joints, the first free and three locked, that carries
    ``branches`` short chains of ``links`` links on fixed joints.

    Size grows with the number of chains, not with the fineness of a mesh: the round-off of a beam
    cut into n elements grows like n⁴. Eleven variables: three locked joints, four diameters of the
    trunk and four masses on it; n_dof = 3 · 4 · 4 + 3 · branches · links · elements + 1.
    """
    trunk = [f"trunk{k}" for k in range(4)]
    data: dict[str, Any] = {
        "title": "Trunk with chains",
        "mechanism": {
            "space": "planar",
            "materials": {"steel": STEEL, "carbon": CARBON},
            "sections": {
                **{f"trunk{k}": {"shape": "circle", "diameter": 0.08 - 0.01 * k} for k in range(4)},
                "twig": {"shape": "circle", "diameter": 0.01},
            },
            "links": {
                name: {"length": 0.5, "material": "steel", "section": name, "elements": 4}
                for name in trunk
            },
            "joints": {
                f"joint{k}": {
                    "type": "revolute",
                    "base": f"trunk{k - 1}.end" if k else "ground",
                    "follower": f"{name}.start",
                }
                for k, name in enumerate(trunk)
            },
            "bodies": {f"mass{k}": {"at": f"{n}.end", "mass": 2.0} for k, n in enumerate(trunk)},
        },
        "coordinates": {
            f"q{k}": {"joint": f"joint{k}", "drive": "locked" if k else "free"} for k in range(4)
        },
        "design": {
            **{
                f"d{k}": {"parameter": f"sections.trunk{k}.diameter", "min": 0.02, "max": 0.1}
                for k in range(4)
            },
            **{
                f"m{k}": {"parameter": f"bodies.mass{k}.mass", "min": 0.0, "max": 5.0}
                for k in range(4)
            },
        },
    }
    for branch in range(branches):
        _hang_chain(data["mechanism"], branch, links, elements)
    return data


def _hang_chain(mechanism: dict[str, Any], branch: int, links: int, elements: int) -> None:
    base = f"trunk{branch % 4}.end"
    for k in range(links):
        name = f"twig{branch}_{k}"
        mechanism["links"][name] = {
            "length": 0.05 + 0.0005 * (branch % 7),
            "material": "carbon",
            "section": "twig",
            "elements": elements,
        }
        mechanism["joints"][f"at_{name}"] = {
            "type": "fixed",
            "base": base,
            "follower": f"{name}.start",
            "angle": 0.4 + 0.37 * branch if k == 0 else 0.3,
        }
        base = f"{name}.end"


def remove_link(data: dict[str, Any], k: int) -> None:
    """Take link k, the last one of a serial arm, off again."""
    mechanism = data["mechanism"]
    del mechanism["links"][f"link{k}"], mechanism["joints"][f"joint{k}"]
    del mechanism["sections"][f"rod{k}"], mechanism["bodies"][f"mass{k}"]
    del data["coordinates"][f"q{k}"]
