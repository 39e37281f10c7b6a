"""Frames: their bytes, what is refused in a description, and how they are found and counted in any bytes."""

import dataclasses
from math import radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.machine.link import frame_format
from spheretwin.machine.link.admission import Admission
from spheretwin.machine.link.channel import Counts, Decoder, SequenceCheck
from spheretwin.machine.link.codec import Codec, crc16
from spheretwin.models.base.errors import InputError
from tests.twin.machine.link.lines import COMMAND, GROUPS, MEASUREMENT, command, measurement

CODECS = {name: Codec(frame_format.load(name).measurement, GROUPS) for name in frame_format.shipped()}
numbers = st.floats(-1e6, 1e6)


def test_the_checksum_is_that_of_the_catalogue():
    # Check value of CRC-16/CCITT-FALSE (IBM-3740) in the catalogue of parametrised CRC algorithms.
    assert crc16(b"123456789") == 0x29B1


@pytest.mark.parametrize("name", ["spheretwin", "spheretwin_json"])
@given(angle=st.tuples(numbers, numbers, numbers), sequence=st.integers(0, 2**32 - 1), current=numbers)
def test_own_frames_carry_every_bit(name, angle, sequence, current):
    values = {"sequence": sequence, "echo": 3, "session": sequence, "flags": 5, "time": 0.1, "angle": angle,
              "rate": (np.nan,) * 3, "current": np.full(GROUPS, current), "temperature": 21.5}  # fmt: skip
    back = CODECS[name].decode(CODECS[name].encode(values).rstrip(b"\n") if "json" in name else
                               CODECS[name].encode(values))  # fmt: skip
    assert back.keys() == values.keys()
    for field, value in values.items():
        np.testing.assert_array_equal(back[field], value)


def test_the_pose_frame_of_another_firmware_has_16_bytes():
    codec = CODECS["ventusff_pose"]
    # 90, -45 and 0.5 as big-endian IEEE 754 single precision.
    frame = b"^" + bytes.fromhex("42b40000 c2340000 3f000000") + b"^\r\n"
    assert codec.size == len(frame) == 16
    np.testing.assert_allclose(codec.decode(frame)["angle"], [radians(d) for d in (90, -45, 0.5)], rtol=1e-15)
    assert codec.encode({"angle": [radians(d) for d in (90, -45, 0.5)]}) == frame


def raw(**field):
    return Codec(
        frame_format.FrameFormat.model_validate(
            {"byte_order": "big", "field": ({"name": "angle", "type": "int16", "count": 1, **field},)}
        ),
        GROUPS,
    )


def test_raw_counts_have_scale_offset_and_unit():
    codec = raw(unit="deg", scale=0.01, offset=-90.0)
    assert codec.encode({"angle": radians(-90 + 3.21)}) == (321).to_bytes(2, "big")
    # One rounding of a product and one of a sum, of numbers up to 2 rad.
    assert codec.decode((321).to_bytes(2, "big"))["angle"] == pytest.approx(radians(-86.79), abs=1e-15)


@pytest.mark.parametrize(
    ("angle", "count"), [(1e9, 32767), (-1e9, -32768), (np.nan, -32768), (np.inf, -32768), (2.6, 3)]
)
def test_integers_saturate_and_their_lowest_value_stands_for_none(angle, count):
    assert raw().encode({"angle": angle}) == count.to_bytes(2, "big", signed=True)


def test_a_number_beyond_single_precision_becomes_infinite():
    codec = raw(type="float32")
    assert codec.decode(codec.encode({"angle": -1e200}))["angle"] == -np.inf
    assert codec.decode(codec.encode({"angle": 1e38}))["angle"] == np.float32(1e38)


def test_a_missing_integer_is_no_number():
    assert np.isnan(raw().decode(b"\x80\x00")["angle"])
    assert np.all(np.isnan(MEASUREMENT.decode(measurement(1))["current"]))


@pytest.mark.parametrize("codec", [MEASUREMENT, COMMAND], ids=["measurement", "command"])
def test_every_frame_with_one_wrong_bit_is_refused(codec):
    frame = measurement(7) if codec is MEASUREMENT else command(7)
    for bit in range(8 * len(frame)):
        wrong = bytearray(frame)
        wrong[bit // 8] ^= 1 << bit % 8
        assert codec.decode(bytes(wrong)) is None


@pytest.mark.parametrize("name", CODECS)
@pytest.mark.parametrize("datagrams", [True, False])
@given(angle=st.tuples(*[st.floats()] * 3), cut=st.floats(0, 1))
def test_a_frame_of_any_numbers_is_read_and_a_part_of_it_is_not(name, datagrams, angle, cut):
    codec, decoder = CODECS[name], Decoder(CODECS[name], datagrams=datagrams)
    frame = codec.encode({"sequence": 1, "time": angle[0], "angle": angle, "rate": angle})
    shapes = [np.shape(each["angle"]) for each in decoder.feed(frame)]
    assert shapes == [(3,)] or (shapes == [] and not np.all(np.abs(angle) < 1e30))
    assert decoder.feed(frame[: int(cut * (len(frame) - 2))]) == []


@pytest.mark.parametrize("name", CODECS)
@pytest.mark.parametrize("datagrams", [True, False])
@given(content=st.binary(max_size=400), chunk=st.integers(1, 400))
def test_no_bytes_raise(name, datagrams, content, chunk):
    decoder = Decoder(CODECS[name], datagrams=datagrams)
    hostile = CODECS[name].start + content + b"\n"
    for first in range(0, len(hostile), chunk):
        decoder.feed(hostile[first : first + chunk])
    if name != "ventusff_pose":  # it has no checksum
        assert decoder.counts.accepted == 0


HOSTILE_LINES = [
    b"[" * 5000, b"9" * 5000, b'{"angle":1e999}', b"{}", b"null", b'{"angle":[1,2]}', b"\xff\xfe", b"\x00",
    b'{"angle":[1,2,"3"]}', b'{"angle":[1,2,true]}', b'{"angle":[[],[],[]]}', b"[" * 70000,
    b'{"angle":[' + b"9" * 400 + b",0,0]}",
]  # fmt: skip


@pytest.mark.parametrize("line", HOSTILE_LINES, ids=range(len(HOSTILE_LINES)))
def test_hostile_lines_are_counted(line):
    frame = frame_format.FrameFormat.model_validate({"encoding": "json", "field": ({"name": "angle"},)})
    decoder = Decoder(Codec(frame, GROUPS), datagrams=False)
    good = b'{"angle":[1,2,3]}\n'
    assert len(decoder.feed(line + b"\n" + good)) == 1
    assert (decoder.counts.accepted, decoder.counts.corrupt) == (1, 1)


def test_an_unknown_description_is_refused_with_the_valid_names():
    with pytest.raises(InputError, match=r"spheretwin_json.*did you mean spheretwin\?"):
        frame_format.load("spheretwim")


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
