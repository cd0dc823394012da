"""Case files of mechanisms whose frequencies an independent frame program computed."""

from __future__ import annotations

import math
from pathlib import Path

AREA = math.sqrt(4.0 * math.pi * 3.97e-8)  # of a solid rod; printed as 7.0632e-4 m2
TWO_LINK = (
    Path(__file__)
    .with_name("reference_mechanisms_two_link.yaml")
    .read_text(encoding="utf-8")
    .replace("AREA", f"{AREA!r}")
    .replace("DENSITY", f"{1.9 / AREA!r}")
)

FOUR_BAR = (
    Path(__file__).with_name("reference_mechanisms_four_bar.yaml").read_text(encoding="utf-8")
)

SLIDER_CRANK = (
    Path(__file__).with_name("reference_mechanisms_slider_crank.yaml").read_text(encoding="utf-8")
)

ARM_3R = Path(__file__).with_name("reference_mechanisms_arm_3r.yaml").read_text(encoding="utf-8")

GANTRY = Path(__file__).with_name("reference_mechanisms_gantry.yaml").read_text(encoding="utf-8")


def two_link(drive: str, masses: tuple[float, float] = (0.0, 0.0), inertia: float = 0.0) -> str:
    """The two-link arm with added masses at elbow and tip, and a rotary inertia at the tip."""
    text = TWO_LINK.replace("MASS_1", f"{masses[0]}").replace("MASS_2", f"{masses[1]}")
    return text.replace("INERTIA", f"{inertia}").replace("DRIVE", drive)
