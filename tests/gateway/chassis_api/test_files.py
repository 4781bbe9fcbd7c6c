"""Files that frames name by URL, and how clients cache them."""

from __future__ import annotations

from rackhand.schemas import topics
from rackhand.services.gateway.ws.files import Files
from tests.gateway import messages
from tests.gateway.harness import Gateway, grey_png


def test_the_map_is_a_file_that_may_be_cached(gateway: Gateway) -> None:
    assert gateway.http.get("/static-files/map-0.png").status_code == 404
    gateway.publish(topics.MAP, messages.current_map())
    with gateway.websocket() as client:
        client.ask({"enable_topic": "/map_v2"})
        url = "/" + client.receive()["data_url"]
    answer = gateway.http.get(url)
    assert (answer.content, answer.headers["content-type"]) == (grey_png(4, 3), "image/png")
    assert answer.headers["cache-control"] == "public, max-age=2592000"
    tag = answer.headers["etag"]
    for known in (tag, f'"other", W/{tag}', "*"):
        again = gateway.http.get(url, headers={"if-none-match": known})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert gateway.http.get(url, headers={"if-none-match": '"other"'}).status_code == 200


def test_capability_and_topics_agree(gateway: Gateway) -> None:
    gateway.publish(topics.CHASSIS_MODEL, messages.model())
    assert gateway.http.get("/device/info").json()["caps"]["supportsCachedTopics"] is True


def test_only_the_newest_files_are_kept() -> None:
    files = Files(kept=2)
    urls = [files.put("map", bytes([number])) for number in (1, 2, 1, 3)]
    kept = [files.get(url.rpartition("/")[2]) for url in urls]
    assert kept == [b"\1", None, b"\1", b"\3"]
