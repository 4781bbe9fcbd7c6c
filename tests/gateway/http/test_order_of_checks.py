"""URL first, then method, then content type, then body: whatever else is wrong with a request."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.gateway.harness import Gateway, new_app

YAML = {"content-type": "text/yaml"}
JSON = {"content-type": "application/json"}
BODY_METHODS = ("POST", "PUT", "PATCH", "DELETE")
DOCUMENT: dict[str, Any] = new_app().openapi()
PATHS = [path for path in DOCUMENT["paths"] if "{name}" not in path and "{arm}" not in path]


def concrete(path: str) -> str:
    return re.sub(r"{\w+_id}", "1", path)


@pytest.mark.parametrize("method", BODY_METHODS)
@pytest.mark.parametrize("path", ["/nowhere", "/chassis/nowhere", "/maps/1/nowhere", "/robots/amr9/chassis/moves"])
def test_an_unknown_url_is_404_whatever_its_body(gateway: Gateway, method: str, path: str) -> None:
    for headers, content in ((YAML, b"a: 1"), (JSON, b"{"), (JSON, b"x" * 1000), ({}, b"")):
        assert gateway.http.request(method, path, headers=headers, content=content).status_code == 404


@pytest.mark.parametrize("path", [path for path in PATHS if "_id}" in path])
def test_an_id_that_is_no_number_is_404_whatever_its_body(gateway: Gateway, path: str) -> None:
    url = re.sub(r"{\w+_id}", "first", path)
    for method in DOCUMENT["paths"][path]:
        for headers, content in ((YAML, b"a: 1"), (JSON, b"{")):
            answer = gateway.http.request(method.upper(), url, headers=headers, content=content)
            assert answer.status_code == 404, (method, url)


@pytest.mark.parametrize("path", PATHS)
def test_another_method_of_a_known_url_is_405_and_names_those_there_are(gateway: Gateway, path: str) -> None:
    known = {method.upper() for method in DOCUMENT["paths"][path]}
    for method in set(BODY_METHODS) - known:
        answer = gateway.http.request(method, concrete(path), headers=YAML, content=b"a: 1")
        assert answer.status_code == 405, (method, path)
        assert known <= set(answer.headers["allow"].split(", "))


@pytest.mark.parametrize("path", PATHS)
def test_another_content_type_of_a_known_url_is_415(gateway: Gateway, path: str) -> None:
    for method in {method.upper() for method in DOCUMENT["paths"][path]} & set(BODY_METHODS):
        for content in (b"a: 1", b"{}"):
            answer = gateway.http.request(method, concrete(path), headers=YAML, content=content)
            assert answer.status_code == 415, (method, path)
            assert answer.json() == {"detail": "Content-Type is 'text/yaml', want application/json"}
