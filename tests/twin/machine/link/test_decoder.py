"""Decoder: frames in a stream, and the counts of lost, duplicated, reordered and corrupt frames."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.machine.link import frame_format
from spheretwin.machine.link.admission import Admission
from spheretwin.machine.link.channel import Counts, Decoder, SequenceCheck
from spheretwin.machine.link.codec import Codec
from tests.twin.machine.link.lines import COMMAND, GROUPS, MEASUREMENT, command, measurement


def counts(**expected):
    return dataclasses.replace(Counts(), **expected)


@pytest.mark.parametrize(
    ("sequences", "accepted", "expected"),
    [
        ((5, 6, 7), [5, 6, 7], counts(accepted=3)),
        ((1, 4), [1, 4], counts(accepted=2, lost=2)),
        ((1, 2, 2), [1, 2], counts(accepted=2, duplicated=1)),
        ((1, 3, 2), [1, 3], counts(accepted=2, reordered=1)),
        ((1, 3, 2, 2), [1, 3], counts(accepted=2, reordered=1, duplicated=1)),
        ((1, 4, 2), [1, 4], counts(accepted=2, lost=1, reordered=1)),
        ((2**32 - 1, 0, 1), [2**32 - 1, 0, 1], counts(accepted=3)),
        ((2**32 - 1, 1), [2**32 - 1, 1], counts(accepted=2, lost=1)),
        ((0, 2**31 - 1), [0, 2**31 - 1], counts(accepted=2, lost=2**31 - 2)),
    ],
)
def test_frames_are_counted_by_their_sequence_numbers(sequences, accepted, expected):
    decoder = Decoder(MEASUREMENT, datagrams=True)
    frames = [frame for number in sequences for frame in decoder.feed(measurement(number))]
    assert ([frame["sequence"] for frame in frames], decoder.counts) == (accepted, expected)


@given(st.permutations(range(20)), st.lists(st.integers(0, 19), max_size=10))
def test_every_frame_is_counted_once_in_any_order(order, again):
    tally = Counts()
    check = SequenceCheck(tally, 256)
    check.is_new(255)  # all of the others are newer
    newest, accepted = -1, 0
    for number in [*order, *again]:
        is_new = check.is_new(number)
        assert is_new == (number > newest)
        accepted, newest = accepted + is_new, max(newest, number)
    assert tally.accepted == accepted + 1
    assert tally.lost == 0  # each has arrived
    assert tally.accepted + tally.reordered + tally.duplicated == 1 + 20 + len(again)
    assert tally.duplicated == len(again)


def test_the_admission_of_a_frame_restarts_the_sequence_or_refuses_it():
    decoder = Decoder(COMMAND, datagrams=True)
    places = iter((Admission.IN_ORDER, Admission.REQUEST, Admission.FIRST, Admission.REFUSED))
    decoder.admission = lambda frame: next(places)
    assert [len(decoder.feed(command(sequence))) for sequence in (1000, 1, 1, 2)] == [1, 1, 1, 0]
    assert decoder.counts == counts(accepted=3, refused=1)


JSON = Codec(frame_format.load("spheretwin_json").measurement, GROUPS)


@pytest.mark.parametrize("codec", [MEASUREMENT, JSON], ids=["binary", "json"])
@given(
    noise=st.lists(st.binary(max_size=30), min_size=4, max_size=4), chunk=st.integers(1, 700), data=st.data()
)
def test_frames_are_found_between_any_bytes_and_in_any_pieces(codec, noise, chunk, data):
    frames = [codec.encode({"sequence": i, "angle": (i, 0.0, 0.0)}) for i in range(3)]
    if codec is JSON:  # a line is a frame: noise is in lines of its own
        noise = [text.replace(b"\n", b"") + b"\n" for text in noise]
    stream = b"".join(text + frame for text, frame in zip(noise, [*frames, b""], strict=True))
    decoder = Decoder(codec, datagrams=False)
    results = [
        frame["angle"][0]
        for first in range(0, len(stream), chunk)
        for frame in decoder.feed(stream[first : first + chunk])
    ]
    assert results == [0.0, 1.0, 2.0]


def test_a_run_of_wrong_bytes_counts_once():
    decoder = Decoder(MEASUREMENT, datagrams=False)
    decoder.feed(b"nonsense" + measurement(1) + b"\xa5\x5a and more" + measurement(2) + b"\xa5")
    assert decoder.counts == counts(accepted=2, corrupt=2)


def test_half_a_datagram_does_not_spoil_the_next_one():
    decoder = Decoder(MEASUREMENT, datagrams=True)
    decoder.feed(measurement(1)[:50])
    assert len(decoder.feed(measurement(2))) == 1
    assert decoder.counts == counts(accepted=1, corrupt=1)


def test_a_line_without_end_does_not_fill_the_memory():
    decoder = Decoder(JSON, datagrams=False)
    for _ in range(100):
        decoder.feed(b"x" * 4096)
    assert len(decoder._rest) <= 65536 + 4096
    assert decoder.counts.corrupt >= 1
    decoder.feed(b"\n")
    assert len(decoder.feed(JSON.encode({"sequence": 1, "angle": (0.0, 0.0, 0.0)}))) == 1
