"""Running eigassign in tests: inside this process, or as a process of its own."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import eigassign

ROOT = Path(eigassign.__file__).parents[1]
TWO_LINK = Path(__file__).parents[2] / "cases" / "two_link.yaml"
SECONDS = 120  # until a process that hangs is a failure
ARM = """
title: Two-link arm
mechanism:
  space: planar
  materials: {al: {youngs_modulus: 70 GPa, density: 2700}}
  sections:
    upper_tube: {shape: tube, outer_diameter: 40 mm, thickness: 3 mm}
    fore_tube: {shape: tube, outer_diameter: 30 mm, thickness: 2 mm}
  links:
    upper_arm: {length: 600 mm, material: al, section: upper_tube, elements: 2}
    forearm: {length: 450 mm, material: al, section: fore_tube, elements: 2}
  joints:
    shoulder: {type: revolute, base: ground, follower: upper_arm.start}
    elbow: {type: revolute, base: upper_arm.end, follower: forearm.start}
  bodies:
    elbow_motor: {at: upper_arm.end, mass: 1.5 kg, inertia: 0.002 kg m2}
    payload: {at: forearm.end, mass: 1 kg}
coordinates:
  q1: {joint: shoulder, drive: {stiffness: 20 kN m/rad}}
  q2: {joint: elbow, drive: {stiffness: 8 kN m/rad}}
trajectory: {points: [[-10 deg, 60 deg], [20 deg, 90 deg]], duration: 1 s, samples: 11}
design:
  diameter: {parameter: sections.upper_tube.outer_diameter, min: 35 mm, max: 50 mm}
  elbow_gear: {parameter: coordinates.q2.drive.stiffness, min: 5 kN m/rad, max: 15 kN m/rad}
targets:
  - {mode: 1, frequency: 15 Hz}
  - {modes: all, keep_out: [24 Hz, 26 Hz]}
"""


def environment(**changes: str) -> dict[str, str]:
    """This process's, with eigassign importable and nothing that bends its output."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "LC_", "LANG"))}
    return {**kept, "PYTHONPATH": str(ROOT), **changes}


def eigassign_process(*args: object, **how: Any) -> subprocess.CompletedProcess[str]:
    """``python -m eigassign *args``, to its end."""
    return python("-m", "eigassign", *args, **how)


def python(*args: object, **how: Any) -> subprocess.CompletedProcess[str]:
    """A Python process, to its end."""
    given: dict[str, Any] = {"env": environment(), "stdin": subprocess.DEVNULL, **how}
    if "stdout" not in given:
        given |= {"stdout": subprocess.PIPE}
    if "stderr" not in given:
        given |= {"stderr": subprocess.PIPE}
    command = [sys.executable, *map(str, args)]
    how_read = {"text": True, "errors": "backslashreplace", "timeout": SECONDS, "check": False}
    return subprocess.run(command, **how_read, **given)
