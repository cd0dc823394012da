"""The shipped arm, and what a small chart of it shows, made once for all tests."""

import pytest
from chart_scenes import TINY
from scenes import SHIPPED, scene_of

from eigassign.chart import ACCURACIES, Chart, compare_methods
from eigassign.study import Scene


@pytest.fixture(scope="session")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("arm"), SHIPPED)


@pytest.fixture(scope="session")
def compared(arm: Scene) -> Chart:
    return compare_methods(arm, TINY, ACCURACIES, lambda line: None)
