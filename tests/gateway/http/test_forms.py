"""Forms as JSON objects."""

from __future__ import annotations

import base64
import json

import httpx
import pytest

from rackhand.services.gateway.http.forms import MalformedForm, form_to_json

NUMBERS = ("size", "count")


def encoded(**fields: str | bytes) -> tuple[bytes, str]:
    """A form as httpx writes it; bytes are files."""
    files = {name: (f"{name}.png", value) for name, value in fields.items() if isinstance(value, bytes)}
    data = {name: value for name, value in fields.items() if isinstance(value, str)}
    request = httpx.Request("POST", "http://h/", data=data, files=files or {"_": (None, "")})
    return request.read(), request.headers["content-type"]


def test_texts_numbers_and_files() -> None:
    binary = bytes(range(256)) + b"\r\n--not the boundary\r\n"
    body, kind = encoded(name="Hälle 1", size="-0.05", count="3", version="7", picture=binary)
    value = json.loads(form_to_json(body, kind, NUMBERS))
    assert base64.b64decode(value.pop("picture")) == binary
    assert value == {"name": "Hälle 1", "size": -0.05, "count": 3, "version": "7"}


def test_a_number_field_that_is_none_stays_text_for_its_reader_to_refuse() -> None:
    body, kind = encoded(size="wide", count="NaN", picture=b"")
    assert json.loads(form_to_json(body, kind, NUMBERS)) == {"size": "wide", "count": "NaN", "picture": ""}


@pytest.mark.parametrize(
    ("body", "kind", "why"),
    [
        (b"", "multipart/form-data", "names no boundary"),
        (b"", "multipart/form-data; boundary=x", "does not end with the boundary"),
        (b"--x\r\n", "multipart/form-data; boundary=x", "does not end with the boundary"),
        (b"--x\r\n\r\nvalue\r\n--x--\r\n", "multipart/form-data; boundary=x", "a part has no name"),
        (
            b'--x\r\nContent-Disposition: form-data; name="a"\r\n\r\n1\r\n'
            b'--x\r\nContent-Disposition: form-data; name="a"\r\n\r\n2\r\n--x--\r\n',
            "multipart/form-data; boundary=x",
            "'a' is given twice",
        ),
        (
            b'--x\r\nContent-Disposition: form-data; name="a"\r\n\r\n\xff\r\n--x--\r\n',
            "multipart/form-data; boundary=x",
            "a: not UTF-8",
        ),
    ],
)
def test_what_is_no_form_is_said_so(body: bytes, kind: str, why: str) -> None:
    with pytest.raises(MalformedForm, match=why):
        form_to_json(body, kind, NUMBERS)
