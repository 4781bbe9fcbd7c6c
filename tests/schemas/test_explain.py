"""Things that explain a move, in words."""

from __future__ import annotations

from rackhand.schemas.explain import Thing


def test_a_thing_says_where_it_is_and_how_much_room_there_is() -> None:
    wall = Thing(role="blocks", kind="virtual wall", name="north", x=3.0, y=1.2, clearance=-0.05, needed=0.05)
    assert wall.sentence == "virtual wall 'north' at (3.00, 1.20): clearance -0.05 m, needed 0.05 m"
    place = wall.model_copy(update={"needed": None})
    assert place.sentence == "virtual wall 'north' at (3.00, 1.20): clearance -0.05 m"


def test_a_thing_that_does_not_block_says_what_it_is_there_for() -> None:
    leg = Thing(role="seen", kind="rack leg", x=1.0, y=2.0)
    assert (leg.title, leg.sentence) == ("seen: rack leg", "seen: rack leg at (1.00, 2.00)")
