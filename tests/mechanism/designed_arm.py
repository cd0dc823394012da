"""An arm whose links change with the design, and can be reduced."""

from spatial_cases import linkage
from spatial_oracle import Tree


def designed(space: str, reduce_to: float = 900.0) -> Tree:
    """Two links whose length and diameter are design; one tapered, one reaching sideways."""
    pad = {"start": 0.0, "knee": 0.1, "top": 0.1, "end": -0.1} if space == "spatial" else {}
    beam = {"length": 0.6, "elements": 9, "material": "m", "section": {"start": "a", "end": "b"}}
    bar = {"material": "m", "section": "a", "elements": 3}
    places = {"start": [0.0, 0.0], "knee": [0.3, 0.1], "top": [0.3, 0.4], "end": [0.7, 0.2]}
    frame = {
        "type": "frame",
        "nodes": {name: place + ([pad[name]] if pad else []) for name, place in places.items()},
        "beams": {
            "one": {"from": "start", "to": "knee", **bar},
            "two": {"from": "knee", "to": "top", **bar, "section": "b"},
            "three": {"from": "top", "to": "end", **bar},
            "four": {"from": "knee", "to": "end", **bar},
        },
    }
    return linkage(
        {
            "beam": {**beam, "reduce_to": reduce_to},
            "frame": {**frame, "reduce_to": reduce_to},
        },
        {
            "j1": {"type": "revolute", "base": "ground", "follower": "beam.start"},
            "j2": {"type": "revolute", "base": "beam.end", "follower": "frame.start"},
        },
        {"q1": {"joint": "j1"}, "q2": {"joint": "j2"}},
        sections={
            "a": {"shape": "circle", "diameter": 0.02},
            "b": {"shape": "circle", "diameter": 0.014},
        },
        space=space,
        bodies={"load": {"at": "frame.end", "mass": 0.4}},
    ) | {
        "design": {
            "length": {"parameter": "links.beam.length", "min": 0.3, "max": 0.9},
            "thick": {"parameter": "sections.a.diameter", "min": 0.012, "max": 0.03},
        }
    }
