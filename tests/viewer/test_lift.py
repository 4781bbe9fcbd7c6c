"""What is drawn of a lift: its cabins, the leaves of its doors, and its state in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas.lift import LiftState
from rackhand.services.viewer.items import Drawing, Note
from rackhand.services.viewer.lift import LiftView, in_words
from tests.gateway import messages


def drawn(view: LiftView, state: LiftState) -> dict[str, Drawing]:
    return {item.entity: item for item in view.state(state) if isinstance(item, Drawing)}


def leaves(drawing: Drawing) -> np.ndarray:
    """Ends of the leaves, (n, 2, 3)."""
    return np.array(drawing.parts[0].strips.as_arrow_array().to_pylist())


@pytest.fixture
def view() -> LiftView:
    view = LiftView("lift_1")
    (cabins,) = view.model(messages.lift_model())
    assert isinstance(cabins, Drawing) and cabins.entity == "lift_1/cabin"
    corners = np.array(cabins.parts[0].strips.as_arrow_array().to_pylist())
    assert corners.shape == (2, 5, 3) and np.ptp(corners[0], axis=0) == pytest.approx((2.3, 2.6, 0.0))
    return view


def test_leaves_are_open_at_the_floor_of_the_cabin_only(view: LiftView) -> None:
    ends = leaves(drawn(view, messages.lift("floor2", opening=0.5))["lift_1/doors"])
    assert ends[:, :, 0] == pytest.approx(np.repeat([21.2, 21.2, 41.2, 41.2], 2).reshape(4, 2))
    assert ends[0, :, 1] == pytest.approx((1.0, 1.7)), "closed: from the middle to the jamb"
    assert ends[2, :, 1] == pytest.approx((1.35, 2.05)) and ends[3, :, 1] == pytest.approx((0.65, -0.05))
    moving = leaves(drawn(view, messages.lift("floor2", opening=0.5, moving=True))["lift_1/doors"])
    assert moving[2, :, 1] == pytest.approx((1.0, 1.7))


def test_the_log_has_each_change_once(view: LiftView) -> None:
    def notes(**fields: Any) -> list[str]:
        return [item.text for item in view.state(messages.lift(**fields)) if isinstance(item, Note)]

    assert notes() == ["at floor1, door open, held by fleet"]
    assert notes(stamp=20) == []
    assert notes(door="closing", blocked=True) == ["at floor1, door closing, blocked, held by fleet"]


def test_a_lift_whose_model_is_not_known_yet_is_logged_but_not_drawn() -> None:
    assert drawn(LiftView("lift_1"), messages.lift()) == {}
    assert in_words(messages.lift(moving=True, target="floor2", holder=None)) == "floor1 to floor2, free"
