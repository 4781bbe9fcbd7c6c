"""Rack jobs on the page, in a real browser over a fake robot: places to choose, orders, racks where they were seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import JackRequest
from rackhand.schemas.moves import CreateMove, MoveCreate, PauseMove
from rackhand.schemas.racks import LoadReport
from tests.gateway import messages
from tests.gateway.browser import browser
from tests.gateway.harness import Gateway, grey_png

OVERLAYS: dict[str, Any] = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "id": name,
            "geometry": {"type": "Point", "coordinates": [x, 1.0]},
            "properties": {"type": "34", "name": name, "yaw": "90"},
        }
        for name, x in (("storage-1", 1.0), ("storage-2", 4.0))
    ]
    + [
        {
            "type": "Feature",
            "id": "zone",
            "geometry": {"type": "Polygon", "coordinates": [[[0.0, 0.0], [5.0, 0.0], [5.0, 2.0], [0.0, 2.0]]]},
            "properties": {"regionType": "17", "name": "storage"},
        }
    ],
}
# How many pixels around a point of the map have the colour of a rack's outline.
COLOURED = """([x, y, colour]) => import("/page/view.js").then(({ View }) => {
  const canvas = document.getElementById("map");
  const view = new View(canvas);
  view.fit({ origin: [-1, -2], size: [160, 160], resolution: 0.05 });
  const ratio = canvas.width / canvas.clientWidth;
  const [px, py] = view.toScreen([x, y]).map((value) => Math.round(value * ratio));
  const value = getComputedStyle(document.documentElement).getPropertyValue(`--map-${colour}`).trim();
  const rgb = [1, 3, 5].map((at) => parseInt(value.slice(at, at + 2), 16));
  const { data } = canvas.getContext("2d").getImageData(px - 4, py - 4, 9, 9);
  let found = 0;
  for (let at = 0; at < data.length; at += 4) {
    found += rgb.every((part, i) => Math.abs(data[at + i] - part) < 12);
  }
  return found;
})"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as launched:
        yield launched


@pytest.fixture
def robot(gateway: Gateway) -> Gateway:
    """At (6, 5) in a hall of 8 m, its jack down, nothing on it."""
    current = messages.current_map(png=grey_png(160, 160))
    assert current.map is not None
    changes = {"overlays": OVERLAYS, "resolution": 0.05}
    gateway.publish(topics.MAP, current.model_copy(update={"map": current.map.model_copy(update=changes)}))
    gateway.publish(topics.CHASSIS_MODEL, messages.model())
    gateway.publish(topics.FOOTPRINT, messages.footprint())
    gateway.publish(topics.POSE, messages.pose(x=5.5, y=4.5, yaw=0.0))
    gateway.publish(topics.CHASSIS_STATUS, messages.status())
    gateway.publish(topics.PLANNING_STATE, messages.planning(move_state="none", action_id=0))
    gateway.publish(topics.JACK, messages.jack())
    gateway.publish(topics.LOAD, LoadReport(stamp=0))
    gateway.publish(topics.MAP_RACK_STATES, messages.rack_states("occupied"))
    return gateway


def opened(chromium: Any, robot: Gateway, **options: Any) -> Page:
    page: Page = chromium.new_page(**({"viewport": {"width": 1280, "height": 900}} | options))
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(robot.url)
    expect(page.locator("#link")).to_have_text("live")
    expect(page.locator("#load")).to_have_text("free")
    page.errors = errors  # type: ignore[attr-defined]
    return page


def created(robot: Gateway) -> list[MoveCreate]:
    return [request.move for request in robot.bus.requests if isinstance(request, CreateMove)]


def jacked(robot: Gateway) -> list[str]:
    return [request.direction for request in robot.bus.requests if isinstance(request, JackRequest)]


def until(page: Page, condition: Callable[[], bool]) -> None:
    """The browser works on meanwhile."""
    for _ in range(500):
        if condition():
            return
        page.wait_for_timeout(20)
    raise AssertionError("did not happen")


def coloured(page: Page, x: float, y: float, colour: str = "rack") -> int:
    return int(page.evaluate(COLOURED, [x, y, colour]))


def until_coloured(page: Page, x: float, y: float, colour: str = "rack") -> None:
    until(page, lambda: coloured(page, x, y, colour) > 3)


def test_a_whole_job_by_the_keyboard(chromium: Any, robot: Gateway) -> None:
    page = opened(chromium, robot)
    place = page.locator("#rack-place")
    expect(place.locator("option")).to_have_text(
        ["choose a rack point", "storage-1 · occupied", "storage-2 · unknown", "any in storage"]
    )
    expect(page.locator("#rack-align")).to_be_disabled()
    place.focus()
    page.keyboard.type("storage-1")
    expect(place).to_have_value("storage-1")
    page.keyboard.press("Tab")
    expect(page.locator("#rack-align")).to_be_focused()
    page.keyboard.press("Enter")
    until(page, lambda: len(created(robot)) == 1)
    expect(page.locator("#rack-carry")).to_be_disabled()

    page.locator("#rack-lift").press("Enter")
    robot.publish(topics.JACK, messages.jack("jacking_up", 0.4))
    expect(page.locator("#jack")).to_contain_text("jacking up · 40 % up")
    assert page.locator("#jack-progress").evaluate("bar => bar.value") == pytest.approx(0.4)
    expect(page.locator("#rack-lift")).to_be_disabled()
    expect(page.locator("#rack-align")).to_be_disabled()
    robot.publish(topics.JACK, messages.jack("hold", 1.0).model_copy(update={"weight": 92.0}))
    robot.publish(topics.LOAD, messages.load())
    expect(page.locator("#jack")).to_contain_text("92 kg")
    expect(page.locator("#load")).to_have_text("carrying")

    place.select_option("area:zone")
    page.locator("#rack-carry").press("Enter")
    until(page, lambda: len(created(robot)) == 2)
    page.locator("#rack-lower").press("Enter")
    until(page, lambda: len(jacked(robot)) == 2)
    expect(page.locator("#toast")).to_be_hidden()

    align, carry = created(robot)
    assert (align.type, align.target_x, align.target_y) == ("align_with_rack", 1.0, 1.0)
    assert align.target_ori == pytest.approx(math.pi / 2)
    assert (carry.type, carry.rack_area_id, carry.target_x) == ("to_unload_point", "zone", None)
    assert jacked(robot) == ["up", "down"]
    assert page.errors == []  # type: ignore[attr-defined]


def test_a_click_on_a_rack_point_chooses_it_and_beside_one_drives(chromium: Any, robot: Gateway) -> None:
    page = opened(chromium, robot)
    click(page, 4.05, 1.05)
    expect(page.locator("#rack-place")).to_have_value("storage-2")
    assert created(robot) == []
    click(page, 4.0, 3.0)
    until(page, lambda: bool(created(robot)))
    (move,) = created(robot)
    assert (move.target_x, move.target_y) == pytest.approx((4.0, 3.0), abs=0.05)


def click(page: Page, x: float, y: float) -> None:
    spot = page.evaluate(
        """([x, y]) => import("/page/view.js").then(({ View }) => {
             const view = new View(document.getElementById("map"));
             view.fit({ origin: [-1, -2], size: [160, 160], resolution: 0.05 });
             return view.toScreen([x, y]);
           })""",
        [x, y],
    )
    page.locator("#map").click(position={"x": spot[0], "y": spot[1]})


def test_racks_are_drawn_where_they_were_measured_and_a_carried_one_moves_with_the_robot(
    chromium: Any, robot: Gateway
) -> None:
    page = opened(chromium, robot)
    robot.publish(topics.SEEN_RACKS, messages.seen_racks(Pose2(x=4.1, y=2.4, yaw=0.0)))
    until_coloured(page, 4.1 + 0.7, 2.4)  # half of 1.2 m and a margin of 0.1 m ahead
    robot.publish(topics.SEEN_RACKS, messages.seen_racks())
    robot.publish(topics.LOAD, messages.load("carrying", Pose2(x=0.0, y=0.0, yaw=0.0)))
    robot.publish(topics.POSE, messages.pose(x=3.0, y=5.0, yaw=0.0))
    until_coloured(page, 3.0 + 0.7, 5.0)
    assert coloured(page, 4.1 + 0.7, 2.4) == 0, "the rack that was there is on the robot now"
    robot.publish(topics.POSE, messages.pose(x=3.0, y=4.0, yaw=0.0))
    until_coloured(page, 3.0 + 0.7, 4.0)
    robot.publish(topics.SEEN_RACKS, messages.seen_racks(Pose2(x=3.0, y=4.0, yaw=0.0)))
    robot.publish(topics.LOAD, LoadReport(stamp=0))
    expect(page.locator("#load")).to_have_text("free")
    until_coloured(page, 3.0 + 0.7, 4.0)


def test_a_rack_that_is_detected_is_drawn_while_it_is(chromium: Any, robot: Gateway) -> None:
    page = opened(chromium, robot)
    robot.publish(topics.DETECTED_RACK, messages.detected_rack())  # its middle at (4, 2.4), 1.19 m along x
    until_coloured(page, 4.0 - 0.595, 2.4, "aim")
    robot.publish(topics.DETECTED_RACK, messages.detected_rack(detected=False))
    until(page, lambda: coloured(page, 4.0 - 0.595, 2.4, "aim") == 0)


def test_the_footprint_in_force_is_drawn_around_the_body(chromium: Any, robot: Gateway) -> None:
    page = opened(chromium, robot)
    until_coloured(page, 5.5 + 0.35, 4.5 + 0.15, "robot")
    shape = messages.footprint()
    robot.publish(
        topics.FOOTPRINT, shape.model_copy(update={"outline": 3 * shape.outline, "expanded": 3 * shape.outline})
    )
    until_coloured(page, 5.5 + 1.2, 4.5, "robot")
    assert coloured(page, 5.5 + 0.8, 4.5, "robot") == 0, "between body and outline nothing is filled"


def test_a_held_move_says_why(chromium: Any, robot: Gateway) -> None:
    page = opened(chromium, robot)
    text = "the jack is moving up; the move starts when it has arrived"
    robot.publish(topics.PLANNING_STATE, messages.planning(message=text, action_type="to_unload_point"))
    expect(page.locator("#move-note")).to_have_text(text)


def test_a_route_is_drawn_by_clicks_and_driven(chromium: Any, robot: Gateway) -> None:
    page = opened(chromium, robot)
    page.locator("#route").click()
    expect(page.locator("#route-drive")).to_be_hidden()
    for x, y in ((4.0, 4.0), (4.0, 1.0), (2.0, 3.0)):  # the second one is a rack point, which is not chosen now
        click(page, x, y)
    expect(page.locator("#rack-place")).to_have_value("")
    page.locator("#route-drive").click()
    until(page, lambda: bool(created(robot)))
    (move,) = created(robot)
    assert (move.type, move.detour_tolerance) == ("along_given_route", 0)
    assert move.route_coordinates is not None
    numbers = [float(number) for number in move.route_coordinates.split(",")]
    assert numbers == pytest.approx([4.0, 4.0, 4.0, 1.0, 2.0, 3.0], abs=0.05)
    expect(page.locator("#route-drive")).to_be_hidden()
    expect(page.locator("#route")).to_have_text("Draw a route")


def test_a_move_is_paused_and_resumed_and_the_charger_is_a_button(chromium: Any, robot: Gateway) -> None:
    page = opened(chromium, robot)
    expect(page.locator("#pause")).to_be_disabled()
    page.locator("#charge-move").click()
    until(page, lambda: bool(created(robot)))
    assert (created(robot)[0].type, created(robot)[0].target_x) == ("charge", None)
    robot.publish(topics.PLANNING_STATE, messages.planning(action_id=1, action_type="charge"))
    page.locator("#pause").click()
    until(page, lambda: paused(robot) == [True])
    robot.publish(topics.PLANNING_STATE, messages.planning(action_id=1, paused=True, message="paused by a client"))
    expect(page.locator("#pause")).to_have_text("Resume")
    expect(page.locator("#move-note")).to_have_text("paused by a client")
    page.locator("#pause").click()
    until(page, lambda: paused(robot) == [True, False])


def paused(robot: Gateway) -> list[bool]:
    return [request.paused for request in robot.bus.requests if isinstance(request, PauseMove)]


def test_buttons_are_large_enough_for_a_finger_on_a_phone(chromium: Any, robot: Gateway) -> None:
    page = opened(chromium, robot, viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True)
    for name in ("rack-place", "rack-align", "rack-lift", "rack-carry", "rack-lower"):
        box = page.locator(f"#{name}").bounding_box()
        assert box is not None and box["height"] >= 40 and box["x"] + box["width"] <= 390, name
    page.locator("#rack-place").select_option("storage-2")
    page.locator("#rack-align").tap()
    until(page, lambda: bool(created(robot)))
    assert created(robot)[0].type == "align_with_rack"
