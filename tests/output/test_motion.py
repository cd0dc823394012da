"""Animations: as many frames as poses, each another, the same bytes every time."""

from __future__ import annotations

import io
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageSequence

import eigassign as ea
from eigassign.output import along_trajectory, encode_animation
from eigassign.output import swinging as swinging_mode
from eigassign.study import draw_modes, moving_poses

CASES = Path(__file__).parents[2] / "cases"


@pytest.fixture(scope="module")
def swinging() -> Any:
    case = ea.load_case(CASES / "two_link.yaml")
    pictures = draw_modes(case.file, case.model(), np.array([1.8, 5.3]), case.initial_design, 1)
    return swinging_mode(pictures, 0)


def frames(data: bytes) -> list[np.ndarray]:
    image = Image.open(io.BytesIO(data))
    assert image.info["loop"] == 0  # for ever
    return [np.asarray(frame.convert("RGB")).astype(int) for frame in ImageSequence.Iterator(image)]


def test_a_mode_swings_through_rest_to_the_opposite_and_back(swinging: Any) -> None:
    ends = [lines[-1][-1] for lines in swinging.moving.lines]  # the tip of the last link
    rest, n = swinging.still.lines[0][-1][-1], len(ends)
    np.testing.assert_allclose(ends[n // 4], rest, atol=1e-12)
    np.testing.assert_allclose(ends[n // 2] - rest, rest - ends[0], atol=1e-12)
    np.testing.assert_allclose(ends[n // 8], ends[n - n // 8], atol=1e-12)
    assert np.linalg.norm(ends[0] - rest) > 0.01


@pytest.mark.parametrize("kind", ["gif", "png"])
def test_every_frame_shows_its_pose(swinging: Any, kind: str) -> None:
    few = [0, 5, 11, 20]
    moving = replace(
        swinging.moving,
        lines=tuple(swinging.moving.lines[k] for k in few),
        time_s=np.zeros(4),
    )
    data = encode_animation(replace(swinging, moving=moving, captions=("a", "b", "c", "d")), kind)
    shown = frames(data)
    assert len(shown) == len(few)
    for one, other in pairwise(shown):
        assert (np.abs(one - other).max(axis=2) > 60).mean() > 1e-3
    white = np.array([255, 255, 255])
    assert all(np.abs(frame[0, 0] - white).max() <= 8 for frame in shown)


def test_what_moved_leaves_no_trace(swinging: Any) -> None:
    shown = frames(encode_animation(swinging, "png"))
    assert np.abs(shown[3] - shown[-3]).max() <= 2  # equal poses but for round-off
    assert np.abs(shown[3] - shown[4]).max() > 100


def test_the_same_animation_is_the_same_file(swinging: Any) -> None:
    brief = replace(swinging, captions=("", ""))  # two frames
    assert encode_animation(brief, "gif") == encode_animation(brief, "gif")


def test_poses_along_the_trajectory_are_evenly_spread_in_time() -> None:
    case = ea.load_case(CASES / "arm_3r.yaml")  # in space
    path = case.trajectories[0]
    poses = moving_poses(case.file, case.model(), path, case.initial_design)
    made = along_trajectory(case.file.title, poses)
    assert len(made.captions) == len(poses.lines) <= 75  # three seconds
    spacing = np.diff(poses.time_s)
    step = float(np.diff(path.trajectory.time_s).max())
    assert np.ptp(spacing) <= 2 * step + 1e-12
    assert poses.time_s[0] == path.trajectory.time_s[0]
    assert poses.time_s[-1] == path.trajectory.time_s[-1]
    assert made.captions[-1].endswith(f"t = {poses.time_s[-1]:.3g} s")
