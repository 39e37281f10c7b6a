"""Checksums against their definitions: files that were written before must stay readable."""

import json
import zlib

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.models.telemetry.checksums import line_checksums, line_numbers, values_checksum

LINES = st.lists(st.tuples(st.integers(0, 2**62), st.sampled_from(["INFO", "WARN"]), st.text(max_size=9)))


@settings(max_examples=40)
@given(LINES, st.integers(0, 2**31 - 100))
def test_a_line_has_its_number_above_its_checksum(lines, first):
    sums = line_checksums(lines, first)
    assert sums.dtype == np.uint64
    for place, (line, received) in enumerate(zip(lines, sums.tolist(), strict=True)):
        assert received == (first + place) * 2**32 + zlib.crc32(json.dumps(line).encode())
    assert line_numbers(sums).tolist() == list(range(first, first + len(lines)))


@given(st.lists(st.floats()), st.integers(0, 20))
def test_the_checksum_of_numbers_is_that_of_their_bytes_and_continues(numbers, split):
    values = np.array(numbers)
    whole = values_checksum(values)
    assert whole == zlib.crc32(values.astype("<f8").tobytes())
    assert values_checksum(values[split:], values_checksum(values[:split])) == whole
