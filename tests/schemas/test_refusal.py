"""Refusals on the wire: every code comes back as the same member, and nothing else is a code."""

from __future__ import annotations

import msgspec
import pytest

from rackhand.schemas.codec import MalformedMessage, codec_for
from rackhand.schemas.refusal import Refusal, RefusalCode, RequestRefused

CODEC = codec_for(Refusal)


@pytest.mark.parametrize("code", RefusalCode)
def test_code_is_a_plain_string_on_the_wire_and_a_member_on_both_sides(code: RefusalCode) -> None:
    sent = CODEC.dumps(Refusal(code=code, text="why"))
    assert msgspec.msgpack.decode(sent) == {"code": code.value, "text": "why"}
    assert CODEC.loads(sent).code is code


def test_unknown_code_is_malformed() -> None:
    payload = msgspec.msgpack.encode({"code": "odd", "text": "why"})
    with pytest.raises(MalformedMessage, match="code: Input should be 'not_found', 'invalid'"):
        CODEC.loads(payload)


def test_exception_text_starts_with_the_code() -> None:
    refused = RequestRefused(RefusalCode.NOT_FOUND, "there is no move 7")
    assert str(refused) == "not_found: there is no move 7"
    assert refused.code == "not_found"  # text on the wire and in logs
