"""What a chart says at its end, before any of it is written."""

from __future__ import annotations

from eigassign.pipeline.chart import _unanswered


def test_a_reason_that_many_methods_share_is_said_once_with_their_names() -> None:
    skipped = (("fit 1", "too many axes"), ("RBF", "too few points"), ("fit 2", "too many axes"))
    assert list(_unanswered(skipped)) == [
        "fit 1, fit 2 have no answer: too many axes",
        "RBF has no answer: too few points",
    ]
    assert not list(_unanswered(()))
