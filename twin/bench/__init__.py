"""The machine of a bench: a session that runs at the clock's pace, and does what it is commanded."""

from spheretwin.twin.bench.bench import Bench as Bench
