"""Frames: their bytes, what is refused in a description, and bytes of any origin."""

from math import radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.machine.link import frame_format
from spheretwin.machine.link.channel import Decoder
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
