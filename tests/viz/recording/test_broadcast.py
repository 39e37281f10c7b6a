"""Broadcast of a growing recording: readers get it in order, memory is bounded, no reader is waited for."""

import itertools
import threading

from spheretwin.viz.recording.live import Broadcast


def piece(number, size=100):
    return number.to_bytes(4, "big").ljust(size, b".")


def number_of(piece):
    return int.from_bytes(piece[:4], "big")


def filled(count, **bounds):
    broadcast = Broadcast(**bounds)
    broadcast.begin(b"first")
    for number in range(count):
        broadcast.send(piece(number))
    return broadcast


def test_a_reader_gets_all_in_order_to_the_end():
    broadcast = filled(20)
    reader = broadcast.read()
    begun = [next(reader) for _ in range(11)]
    for number in range(20, 30):
        broadcast.send(piece(number))
    broadcast.end()
    assert [*begun, *reader] == [b"first", *map(piece, range(30))]


def test_a_late_reader_gets_the_beginning_and_the_kept_pieces():
    broadcast = filled(50, kept_bytes=1000)
    broadcast.end()
    assert list(broadcast.read()) == [b"first", *map(piece, range(40, 50))]


def test_memory_is_bounded_whatever_readers_do():
    broadcast = filled(10, kept_bytes=1000)
    stuck = broadcast.read()
    next(stuck)
    for number in range(10, 10_000):
        broadcast.send(piece(number))
    assert sum(len(each) for _, each in broadcast._pieces) <= 1000
    assert number_of(next(stuck)) >= 9990


def test_a_slow_reader_continues_with_the_newest():
    broadcast = filled(5, behind_bytes=1000)
    reader = broadcast.read()
    assert [number_of(each) for each in itertools.islice(reader, 1, 6)] == [0, 1, 2, 3, 4]
    for number in range(5, 15):
        broadcast.send(piece(number))
    assert number_of(next(reader)) == 5  # just as far behind as it may be
    for number in range(15, 40):
        broadcast.send(piece(number))
    assert number_of(next(reader)) == 39
    broadcast.send(piece(40))
    assert number_of(next(reader)) == 40


def test_history_is_read_whole_however_much_more_it_is_than_a_reader_may_be_behind():
    broadcast = filled(100, behind_bytes=1000)
    broadcast.end()
    assert [number_of(each) for each in broadcast.read()][1:] == list(range(100))


def test_a_reader_waits_for_the_beginning_and_an_end_ends_it():
    broadcast, read = Broadcast(), []
    reader = threading.Thread(target=lambda: read.extend(broadcast.read()))
    reader.start()
    broadcast.begin(b"first")
    broadcast.send(b"second")
    broadcast.end()
    reader.join()
    assert read == [b"first", b"second"]
    never = Broadcast()
    never.end()
    assert list(never.read()) == []
