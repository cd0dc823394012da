"""Small words for error messages: what was found, and what was probably meant."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from itertools import islice

from eigassign.files import printable

_LONGEST = 60  # characters of a value: half a line of a message
_SYNONYMS = {  # what others call it
    **dict.fromkeys(("hinge", "pin", "pivot", "rotary", "rotation", "rotational"), "revolute"),
    **dict.fromkeys(("slider", "linear", "translation", "translational", "sliding"), "prismatic"),
    **dict.fromkeys(("ball", "sphere"), "spherical"),
    **dict.fromkeys(("cardan", "hooke"), "universal"),
    **dict.fromkeys(("weld", "welded", "clamp", "clamped", "rigid"), "fixed"),
    **dict.fromkeys(("helical", "lead_screw", "leadscrew"), "screw"),
    **dict.fromkeys(("world", "base", "fixed", "gnd"), "ground"),
    **dict.fromkeys(("round", "rod", "cylinder", "solid_circle"), "circle"),
    **dict.fromkeys(("pipe", "hollow", "ring"), "tube"),
    **dict.fromkeys(("square", "rect"), "rectangle"),
    **dict.fromkeys(("rhs", "shs", "hollow_rectangle", "square_tube", "rectangular_tube"), "box"),
    **dict.fromkeys(("e", "e_modulus", "modulus", "young", "youngs"), "youngs_modulus"),
    "rho": "density",
    **dict.fromkeys(("nu", "poisson", "poissons"), "poissons_ratio"),
}
_BESIDE = re.compile(
    r"[lcuzt]|u[pn][pne]\d*|.*(\bangle|channel|\b[lcuzt][-_ ]?(profile|section)).*"
)
_TWISTED = (
    ": no beam here has a section that bends out of the plane of its load or twists (its shear "
    "centre is not its centroid); where it is held from both write shape: bare with area and "
    "inertias, else the part as a link of type solid"
)
_MOST_NAMES = 20  # of those that are known: two lines of a message
_MOST_CANDIDATES = 200  # names compared with a misspelt one: keeps hostile files cheap


def shown(value: object) -> str:
    """A value as the file would write it, cut short."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return f".{value}".replace(".-", "-.")
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, (tuple, list)):
        return "a list"
    if isinstance(value, int) and abs(value) >= 10**_LONGEST:
        return "a number of more than 60 digits"
    return short(repr(value))


def short(text: str, longest: int = _LONGEST) -> str:
    """``text``, cut short."""
    return text if len(text) <= longest else text[: longest - 1] + "…"


def suggestion(name: str, known: Iterable[str]) -> str:
    """``"; did you mean 'x'?"`` when something known is close, else nothing."""
    candidates = list(islice(known, _MOST_CANDIDATES))
    close = get_close_matches(name[:_LONGEST], candidates, n=1, cutoff=0.6)
    if "i_profile" in candidates and _BESIDE.fullmatch(name.lower()):
        return _TWISTED
    if _SYNONYMS.get(name.lower()) in candidates:
        close = [_SYNONYMS[name.lower()]]
    return f"; did you mean {close[0]!r}?" if close else ""


def listed(names: Iterable[str]) -> str:
    """Names for a message, at most twenty of them."""
    all_names = [short(printable(name)) for name in islice(names, _MOST_NAMES + 1)]
    more = ", …" if len(all_names) > _MOST_NAMES else ""
    return ", ".join(all_names[:_MOST_NAMES]) + more if all_names else "none"


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Sentence for a name that does not exist: closest match, and all that do exist."""
    names = list(known)
    return f"unknown {kind} {shown(name)}{suggestion(name, names)}; known: {listed(names)}"
