"""Renews the pictures of the documentation, from a cell that really runs: ``python -m docs.make_pictures [NAME …]``.

The page is taken by Chromium, the live view by Rerun's native viewer without a window, on Mesa's lavapipe
(``apt install chromium mesa-vulkan-drivers``).
"""

from __future__ import annotations

import argparse
import copy
import math
import tempfile
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
from PIL import Image
from playwright.sync_api import ViewportSize, expect
from rerun.experimental import ViewerClient

from rackhand.services.launch.demo.console import Output
from rackhand.services.launch.demo.play import on_stage
from rackhand.services.launch.demo.stage import scene_of
from rackhand.services.launch.demo.story import STORY, Pick
from rackhand.testing import Cell, Judge
from rackhand.worlds.world_model import load_world
from tests.gateway.browser import browser, wait_until
from tests.system.driving import Driver
from tests.viewer import native

FOLDER = Path(__file__).parent
MOVE = {"creator": "docs", "type": "standard", "target_x": 15.0, "target_y": 10.3, "target_ori": 0.0}
PAGE = ViewportSize(width=1200, height=740)
PATIENCE = 120_000  # ms
# Of a viewer's window of 1920 × 1080: without Rerun's own bars above and below.
CONTENT = (0, 38, 1920, 1050)
DRAWN = 4.0  # seconds of wall time that the viewer takes, at most, to draw a world that stands


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m docs.make_pictures", description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", help=f"which: {', '.join(PICTURES)} (all if none is named)")
    names = parser.parse_args().names or list(PICTURES)
    for name in names:
        with tempfile.TemporaryDirectory() as folder, Cell(Path(folder), lockstep=False, viewer=True) as cell:
            picture = FOLDER / f"{name}.png"
            PICTURES[name](cell, picture)
        print(f"{picture}: {picture.stat().st_size // 1024} KiB")


def take_page(cell: Cell, picture: Path) -> None:
    """The page, while the robot is half way."""
    with browser() as chromium:
        page = chromium.new_page(viewport=PAGE, device_scale_factor=1.5, locale="en-GB")
        page.goto(cell.http)
        expect(page.locator("#link")).to_have_text("live", timeout=PATIENCE)
        httpx.post(f"{cell.http}/chassis/moves", json=MOVE, timeout=PATIENCE / 1000, trust_env=False).raise_for_status()
        wait_until(page, "document.getElementById('move-progress').value > 0.45")
        page.screenshot(path=picture)


def take_driving(cell: Cell, picture: Path) -> None:
    """The live view's first tab, while the robot is half way and the arm at work."""
    with Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        driver.wait_until_joined()
        cell.wait_until_there("cell/viewer")  # it tells nothing of what was before
        driver.post(MOVE)
        cell.wait_for(lambda: judge.true_pose("amr1").x > 8.0 or None, "the robot is on its way")
        draw_with_arm(driver)
        cell.wait_for(lambda: judge.true_pose("amr1").x > 11.4 or None, "the robot is half way")
        photograph(cell, judge, "Driving", picture)
        driver.close()


def take_arm(cell: Cell, picture: Path) -> None:
    """The live view's tab of the arm, while that draws a figure into the air."""
    with Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        driver.wait_until_joined()
        cell.wait_until_there("cell/viewer")
        begun = judge.now()
        draw_with_arm(driver)
        driver.wait(lambda world: world.clock.stamp * 1e-9 > begun + 9.0, "half of the figure is drawn")
        photograph(cell, judge, "Arm", picture)
        driver.close()


def take_demo(cell: Cell, picture: Path) -> None:
    """The demonstration at real time: the live view when the first jar stands on the table, and the page beside it
    (``demo_page.png``). The story is then played to its end."""
    output = Output()
    with (
        Judge(cell.bus) as judge,
        on_stage(cell, scene_of(load_world("warehouse")), output) as player,
        browser() as chromium,
    ):
        cell.wait_until_there("cell/viewer")
        first = next(i for i, step in enumerate(STORY, 1) if isinstance(step.action, Pick))
        player.play(STORY[:first])
        page = chromium.new_page(viewport=PAGE, device_scale_factor=1.5, locale="en-GB")
        page.goto(cell.http)
        expect(page.locator("#link")).to_have_text("live", timeout=PATIENCE)
        wait_until(page, "document.getElementById('load').textContent.trim() !== ''")
        page.screenshot(path=picture.with_name("demo_page.png"))
        photograph(cell, judge, "Driving", picture)
        judge.resume()
        player.play(STORY[first:])
    output.table()


def draw_with_arm(driver: Driver) -> None:
    """A crown of three waves around where the tool is, twice over."""

    def command(**request: Any) -> None:
        answer = driver.request("POST", "/motion/arm1/command", {"priority": 10, **request})["message"]
        assert answer is True or answer["code"] == 200, answer

    start = driver.cell.wait_for(lambda: tool_pose(driver), "the arm has told where it is")
    x, y, z = start["Position"]
    crown = []
    for i in range(2 * 36 + 1):
        angle = math.tau * i / 36
        pose = copy.deepcopy(start)
        pose["Position"] = [
            x + 0.14 * (math.cos(angle) - 1.0),
            y + 0.14 * math.sin(angle),
            z - 0.05 + 0.05 * math.cos(3 * angle),
        ]
        crown.append(pose)
    command(command="lockControl", keepAlive=120.0)
    command(command="setProfileVelocity", type="task", data=[0.12] * 3 + [1.0] * 3)
    command(command="appendPath", type="task", data=crown, method=2, reference=1)


def tool_pose(driver: Driver) -> dict[str, Any] | None:
    pose: dict[str, Any] | None = driver.request("GET", "/motion/arm1/status")["taskPose"].get("value")
    return pose


def show_tab(viewer: ViewerClient, name: str) -> None:
    """Bring a tab to the front."""
    found = native.until(lambda: tabs_with(viewer.get_blueprint().blueprint, name), f"there is a tab {name}")
    viewer.set_blueprint(found, of="recording")


def tabs_with(blueprint: dict[str, Any], name: str) -> dict[str, Any] | None:
    """A blueprint whose tab of that name is in front; None where it has none."""
    changed = copy.deepcopy(blueprint)
    boxes = {
        path.strip("/"): part["ContainerBlueprint"] for path, part in changed.items() if "ContainerBlueprint" in part
    }
    for box in boxes.values():
        for content in box["contents"] if box["container_kind"] == "Tabs" else ():
            if boxes.get(content, {}).get("display_name") == name:
                box["active_tab"] = content
                return changed
    return None


def photograph(cell: Cell, judge: Judge, tab: str, picture: Path) -> None:
    """A tab of a viewer that comes late, to a world that stands: drawing takes the time that moving would need."""
    judge.pause()
    with native.viewer(cell.viewer_stream) as viewer:
        time.sleep(DRAWN)
        show_tab(viewer, tab)
        time.sleep(DRAWN)
        with Image.open(BytesIO(viewer.take_screenshot())) as image:
            image.convert("RGB").crop(CONTENT).save(picture, optimize=True)


PICTURES: dict[str, Callable[[Cell, Path], None]] = {
    "page": take_page,
    "driving": take_driving,
    "arm": take_arm,
    "demo": take_demo,
}


if __name__ == "__main__":
    main()
