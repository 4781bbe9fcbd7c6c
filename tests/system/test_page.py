"""The page in a real browser, over a real cell: it shows, drives and cancels, and loads nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
from playwright.sync_api import Page, expect

from rackhand.testing import Cell
from tests.gateway.browser import browser, wait_until
from tests.viewer import reading

PATIENCE = 60_000  # ms; bounds on hanging, nothing is measured by them
NEAR = (5.2, 3.0)  # in the aisle below the shelves, not far from where the robot starts
FAR = (15.0, 10.3)  # in the other half of the hall
INSIDE = (7.6, 3.6)  # in a shelf

# Every state the page shows of a move, in order: what shows for a moment only would be missed by looking now and then.
RECORD = """
addEventListener("DOMContentLoaded", () => {
  const badge = document.getElementById("move-state");
  window.shown = [];
  if (!badge) return;
  const note = () => shown.push(badge.textContent);
  new MutationObserver(note).observe(badge, { childList: true, characterData: true, subtree: true });
});
"""
# A share of the canvas has the walls' colour.
WALLS_ARE_DRAWN = """() => {
  const canvas = document.getElementById("map");
  const wall = getComputedStyle(document.documentElement).getPropertyValue("--map-wall").trim();
  const rgb = [1, 3, 5].map((at) => parseInt(wall.slice(at, at + 2), 16));
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let walls = 0;
  for (let at = 0; at < data.length; at += 4) walls += rgb.every((value, i) => data[at + i] === value);
  return walls > 0.02 * canvas.width * canvas.height;
}"""
expect.set_options(timeout=PATIENCE)


@dataclass
class Watched:
    """A page, and what it did that it should not have."""

    page: Page
    errors: list[str] = field(default_factory=list)
    hosts: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.page.set_default_timeout(PATIENCE)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda text: self.errors.append(text.text) if text.type == "error" else None)
        self.page.on("request", lambda request: self._seen(request.url))
        self.page.on("websocket", lambda socket: self._seen(socket.url))
        self.page.add_init_script(RECORD)

    def _seen(self, url: str) -> None:
        if not url.startswith("data:"):
            self.hosts.add(urlsplit(url).netloc)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    """In real time nearly, so that a move can be watched, and cancelled while it runs. The viewer makes recordings."""
    with Cell(tmp_path_factory.mktemp("cell"), lockstep=False, speed=2, viewer=True) as cell:
        yield cell


@pytest.fixture
def watched(cell: Cell) -> Iterator[Watched]:
    with browser() as chromium:
        page = chromium.new_page(viewport={"width": 1280, "height": 800}, locale="en-GB")
        watched = Watched(page)
        page.goto(cell.http + "/")
        expect(page.locator("#link")).to_have_text("live")
        expect(page.locator("#pose")).to_contain_text("m ·")
        yield watched


def click_on_map(page: Page, point: tuple[float, float]) -> None:
    """Click where the page draws a point of the map. It shows all of the map, as fits."""
    spot: list[float] = page.evaluate(
        """async (point) => {
             const socket = new WebSocket(`ws://${location.host}/ws/v2/topics`);
             socket.onopen = () => socket.send('{"enable_topic": "/map"}');
             const map = await new Promise((resolve) => {
               socket.onmessage = ({ data }) => {
                 const message = JSON.parse(data);
                 if (message.topic === "/map") resolve(message);
               };
             });
             socket.close();
             const { View } = await import("/page/view.js");
             const view = new View(document.getElementById("map"));
             view.fit(map);
             return view.toScreen(point);
           }""",
        list(point),
    )
    page.locator("#map").click(position={"x": spot[0], "y": spot[1]})


def newest_move(cell: Cell) -> dict[str, Any]:
    http = httpx.Client(base_url=cell.http, trust_env=False, timeout=PATIENCE / 1000)
    with http:
        newest = http.get("/chassis/moves?limit=1").raise_for_status().json()[0]["id"]
        return dict(http.get(f"/chassis/moves/{newest}").raise_for_status().json())


def test_it_shows_the_robot_and_loads_nothing_from_elsewhere(cell: Cell, watched: Watched) -> None:
    page = watched.page
    expect(page.locator("#robot")).to_contain_text("amr1")
    expect(page.locator("#battery")).to_contain_text("%")
    expect(page.locator("#health")).to_have_text("up")
    expect(page.locator("#modes .chosen")).to_have_text("auto")
    expect(page.locator("#services li")).to_have_count(9)  # six processes; drivers of two robots, a lift
    wait_until(page, f"({WALLS_ARE_DRAWN})()")
    assert watched.errors == []
    assert watched.hosts == {urlsplit(cell.http).netloc}


def test_the_documentation_works_without_a_network(cell: Cell, watched: Watched) -> None:
    watched.page.goto(cell.http + "/docs")
    expect(watched.page.get_by_text("Create Move")).to_be_visible()
    assert watched.errors == []
    assert watched.hosts == {urlsplit(cell.http).netloc}


def test_a_click_drives_there(cell: Cell, watched: Watched) -> None:
    page = watched.page
    click_on_map(page, NEAR)
    wait_until(page, "shown.includes('moving') && shown.lastIndexOf('succeeded') > shown.indexOf('moving')")
    move = newest_move(cell)
    assert (move["creator"], move["type"], move["state"]) == ("gateway page", "standard", "succeeded")
    assert [move["target_x"], move["target_y"]] == pytest.approx(NEAR, abs=0.05)
    expect(page.locator("#move-id")).to_have_text(f"#{move['id']}")
    expect(page.locator("#moves li").first).to_contain_text("succeeded")
    assert watched.errors == []


def test_the_button_cancels_and_the_stop_holds(cell: Cell, watched: Watched) -> None:
    page = watched.page
    click_on_map(page, FAR)
    expect(page.locator("#move-state")).to_have_text("moving")
    page.locator("#stop").click()
    expect(page.locator("#stopped")).to_be_visible()
    expect(page.locator("#stop")).to_have_text("Release the stop")
    page.locator("#stop").click()
    expect(page.locator("#stopped")).to_be_hidden()
    page.locator("#cancel").click()
    expect(page.locator("#move-state")).to_have_text("cancelled")
    expect(page.locator("#cancel")).to_be_disabled()
    assert newest_move(cell)["state"] == "cancelled"


def test_a_joint_is_jogged_while_its_button_is_held_and_the_stop_holds(watched: Watched) -> None:
    page = watched.page
    expect(page.locator("#arm-state")).to_have_text("at rest")
    page.locator("#arm summary").click()
    angle, forward = page.locator("#arm-joints output").first, page.locator("#arm-joints button").nth(1)
    before = angle.inner_text()
    forward.hover()
    page.mouse.down()
    expect(page.locator("#arm-holder")).to_contain_text("priority 50")
    expect(angle).not_to_have_text(before)
    page.mouse.up()
    expect(page.locator("#arm-holder")).to_have_text("nobody")
    page.locator("#arm-stop").click()
    expect(page.locator("#arm-state")).to_have_text("stopped")
    at_rest = angle.inner_text()
    forward.hover()
    page.mouse.down()
    expect(page.locator("#toast")).to_contain_text("release the stop first")
    page.mouse.up()
    assert angle.inner_text() == at_rest
    page.locator("#arm-stop").click()
    expect(page.locator("#arm-state")).to_have_text("at rest")


def test_a_fault_is_caused_shown_and_cleared(watched: Watched) -> None:
    page = watched.page
    page.locator("#fault").select_option("emergency_stop_button")
    page.locator("#fault-target").select_option("amr1")
    page.locator("#fault-cause").click()
    expect(page.locator("#stopped")).to_be_visible()
    expect(page.locator("#fault-list li")).to_contain_text("amr1")
    page.locator("#fault-list button").click()
    expect(page.locator("#fault-list li")).to_have_count(0)
    expect(page.locator("#stopped")).to_be_hidden()
    page.locator("#fault").select_option("person_standing")
    page.locator("#fault-cause").click()
    click_on_map(page, FAR)
    expect(page.locator("#fault-list li")).to_contain_text("person_standing_1")
    page.locator("#fault-list button").click()
    expect(page.locator("#fault-list li")).to_have_count(0)
    assert watched.errors == []


def test_what_is_refused_is_reported(cell: Cell, watched: Watched) -> None:
    page = watched.page
    page.route("**/chassis/moves", lambda route: route.continue_(post_data='{"type": "standard"}'))
    click_on_map(page, NEAR)
    expect(page.locator("#toast")).to_contain_text("must be provided")
    page.locator("#toast-close").click()
    expect(page.locator("#toast")).to_be_hidden()


def test_a_failed_move_is_explained_and_saved_as_a_recording_by_the_keyboard(cell: Cell, watched: Watched) -> None:
    page = watched.page
    expect(page.locator("#move-record")).to_be_hidden()
    click_on_map(page, INSIDE)
    expect(page.locator("#move-state")).to_have_text("failed")
    expect(page.locator("#move-why")).to_contain_text("the goal footprint overlaps")
    save = page.locator("#move-record")
    with page.expect_download() as begun:
        save.press("Enter")
    file = begun.value
    assert file.suggested_filename == f"move_{newest_move(cell)['id']}.rrd"
    found = reading.entities(file.path())
    assert {"amr1/cause", "amr1/costmap", "amr1/speed/forward", "tf"} <= found, found
    expect(page.locator("#toast")).to_be_hidden()
    page.route("**/download.rrd", lambda route: route.fulfill(status=503, json={"detail": "no viewer runs"}))
    save.press("Enter")
    expect(page.locator("#toast")).to_have_text("Refused (503): no viewer runs×")
    expect(save).to_be_enabled()
