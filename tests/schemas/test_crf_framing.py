"""Packet framing: the published vector, round trips in pieces, and garbage."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rackhand.schemas.crf_framing import JSON_PACKET, SYNC, Decoder, Packet, checksum, encode

VECTOR = bytes.fromhex(
    "7e7e7e7e7e7e" "2103" "17000000" "0000000000000000" "00" "3b"
    "7b22636f6d6d616e64223a22676574537461747573227d"
)  # fmt: skip

PACKETS = st.builds(
    Packet,
    payload=st.binary(max_size=64),
    type=st.sampled_from([801, 802, 7]),
    timestamp=st.integers(-(2**63), 2**63 - 1),
    writer=st.integers(0, 255),
)


def in_pieces(decoder: Decoder, data: bytes, cuts: list[int]) -> list[Packet]:
    edges = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    return [packet for a, b in pairwise(edges) for packet in decoder.feed(data[a:b])]


def test_the_published_vector() -> None:
    packet = Packet(b'{"command":"getStatus"}')
    assert encode(packet) == VECTOR
    assert Decoder().feed(VECTOR) == [packet]
    assert packet.type == JSON_PACKET == 801


@given(st.lists(PACKETS, max_size=5), st.lists(st.integers(0, 10_000), max_size=8))
def test_round_trip_in_any_pieces(packets: list[Packet], cuts: list[int]) -> None:
    decoder = Decoder()
    assert in_pieces(decoder, b"".join(map(encode, packets)), cuts) == packets
    assert decoder.skipped == 0


@given(st.binary(max_size=40).map(lambda b: b.replace(b"~~~~~~", b"")), PACKETS, st.lists(st.integers(0, 500)))
def test_a_packet_behind_garbage_is_found(garbage: bytes, packet: Packet, cuts: list[int]) -> None:
    decoder = Decoder()
    assert in_pieces(decoder, garbage + encode(packet), cuts) == [packet]
    assert decoder.skipped == len(garbage)


@given(st.integers(1, 40), PACKETS)
@example(1, Packet(b"", type=7, timestamp=5205779732))  # read one byte early, its checksum is right too
def test_a_packet_behind_tildes_is_found(tildes: int, packet: Packet) -> None:
    assert Decoder().feed(b"~" * tildes + encode(packet) + b"\x00" * 32)[0] == packet


@given(st.lists(st.binary(max_size=60) | st.just(SYNC), max_size=20))
def test_garbage_is_survived_and_not_kept(pieces: list[bytes]) -> None:
    decoder = Decoder(max_payload=256)
    for piece in pieces:
        decoder.feed(piece)
    assert len(decoder._buffer) < len(SYNC) + 16 + 256
    found = [packet for _ in range(4) for packet in decoder.feed(encode(Packet(b"x" * 100)))]
    assert found or decoder.too_large, "the decoder no longer hears anything"


def test_a_broken_header_costs_one_packet() -> None:
    broken = bytearray(VECTOR)
    broken[21] ^= 1
    decoder = Decoder()
    assert decoder.feed(bytes(broken) + VECTOR) == [Packet(b'{"command":"getStatus"}')]
    assert decoder.skipped == len(VECTOR)


def test_a_length_beyond_reason_ends_the_reading() -> None:
    decoder = Decoder(max_payload=1000)
    head = (801).to_bytes(2, "little") + (1001).to_bytes(4, "little") + bytes(9)
    wrong = SYNC + head + bytes([checksum(801, 1001, 0, 0) ^ 1])
    right = SYNC + head + bytes([checksum(801, 1001, 0, 0)])
    assert len(decoder.feed(VECTOR + wrong + VECTOR + right + VECTOR)) == 2
    assert decoder.too_large == 1001
    assert decoder.feed(VECTOR) == [] and not decoder._buffer


def test_the_checksum_is_a_byte_whatever_the_sign() -> None:
    assert checksum(801, 23, 0, 0) == 0x3B
    assert checksum(0, 0, -1, 0) == 255
    assert checksum(0, 0, -256, 0) == 255


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        encode(Packet(b"", writer=256))
    with pytest.raises(ValueError, match="at most"):
        encode(Packet(bytes(16 * 1024 * 1024 + 1)))
