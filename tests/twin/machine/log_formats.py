"""Files as other programs write them, with the content of a log: the examples of the page log_formats.md."""

from datetime import UTC, datetime, timedelta

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from spheretwin.models.telemetry import joint_states
from spheretwin.models.telemetry.joint_states import ANGLE_NAMES, MessageEncoder, Topic

START_s = 1764253053
START = datetime.fromtimestamp(START_s, UTC)
GROUPS = range(18)
DEGREES = 180 / np.pi


def lines(*rows):
    return "".join(f"{row}\n" for row in rows)


def rows(log, delimiter, forms):
    """Texts of rows: ``forms`` are functions of time, angles and currents."""
    time, angle, current = forms
    return [
        delimiter.join([time(t_s), *map(angle, q), *map(current, i)])
        for t_s, q, i in zip(log.t_s, log.angle_rad, log.current_A, strict=True)
    ]


def odrive(log, path):
    """Script with odrivetool: seconds since 1970, turns, one driver for each group."""
    names = [f"odrv{18 + axis}.axis0.pos_estimate" for axis in range(3)]
    names += [f"odrv{group}.axis0.motor.foc.Iq_setpoint" for group in GROUPS]
    forms = lambda t_s: f"{START_s + t_s:.6f}", lambda q: f"{q / (2 * np.pi):.7f}", lambda i: f"{i:.5f}"
    path.write_text(lines(",".join(["timestamp", *names]), *rows(log, ",", forms)))


def simplefoc(log, path):
    """Serial monitor: tabs, no names, micros() that start again, mA."""
    first_us = 2**32 - 400_000
    forms = (
        lambda t_s: str(round(first_us + 1e6 * t_s) % 2**32), lambda q: f"{q:.5f}",
        lambda i: f"{1e3 * i:.2f}",
    )  # fmt: skip
    path.write_text(lines(*rows(log, "\t", forms)))


def dspace(log, path):
    """ControlDesk: lines of properties, names and units, values behind an empty column."""
    names = ["time", *(f"Model Root/q[{axis}]" for axis in range(3)), *(f"Model Root/i[{j}]" for j in GROUPS)]
    forms = lambda t_s: f"{t_s:.6f}", lambda q: f"{q * DEGREES:.6f}", lambda i: f"{i:.6f}"
    quoted = ",".join(f'"{name}"' for name in names)
    units = ",".join(["s", *["deg"] * 3, *["A"] * 18])
    values = [f",{row}" for row in rows(log, ",", forms)]
    head = ["format,csv", f"recorded,{START:%d.%m.%Y %H:%M}", "", f"path,{quoted}", f"unit,{units}"]
    path.write_text(lines(*head, *values))


def simulink(log, path):
    """`writetimetable`: durations with their unit."""
    names = ["Time", "alpha", "beta", "gamma", *(f"i_{1 + group}" for group in GROUPS)]
    forms = lambda t_s: f"{t_s:.6g} sec", lambda q: f"{q:.15g}", lambda i: f"{i:.15g}"
    path.write_text(lines(",".join(names), *rows(log, ",", forms)))


def ros_bag(log, path):
    """Two topics, whose messages were stamped 0.2 ms apart."""
    topics = {
        "/joint_states": (0, MessageEncoder(Topic(ANGLE_NAMES, {"position": log.angle_rad}))),
        "/coils": (
            200_000,
            MessageEncoder(Topic([f"coil_{1 + j}" for j in GROUPS], {"effort": log.current_A})),
        ),
    }
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        schema = writer.register_schema(joint_states.TYPE, "ros2msg", joint_states.DEFINITION.encode())
        channels = {name: writer.register_channel(name, "cdr", schema) for name in topics}
        for row, t_s in enumerate(log.t_s):
            for name, (late_ns, encoder) in topics.items():
                stamp = START_s * 10**9 + round(1e9 * t_s) + late_ns
                writer.add_message(channels[name], stamp, encoder.message(row, stamp), stamp)
        writer.finish()


def plotjuggler(log, path):
    """Export of two topics: empty cells where the other topic has a message."""
    names = [f"/joint_states/{axis}/position" for axis in ANGLE_NAMES] + [f"/coils/{j}" for j in GROUPS]
    texts = [",".join(["__time", *names])]
    for t_s, q, i in zip(log.t_s, log.angle_rad, log.current_A, strict=True):
        stamps = (START_s * 10**9 + round(1e9 * t_s) + late_ns for late_ns in (0, 400_000))
        times = [f"{stamp // 10**9}.{stamp % 10**9:09d}" for stamp in stamps]
        texts.append(",".join([times[0], *map(repr, q.tolist()), *[""] * 18]))
        texts.append(",".join([times[1], *[""] * 3, *map(repr, i.tolist())]))
    path.write_text(lines(*texts))


def labview(log, path):
    """LabVIEW measurement file without a column of times, decimal comma."""
    names = ["X_Value", *ANGLE_NAMES, *(f"Current_{j}" for j in GROUPS), "Comment"]
    head = [
        "LabVIEW Measurement", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t,", "X_Columns\tNo",
        f"Date\t{START:%Y/%m/%d}", "***End_of_Header***", "", "Channels\t21",
        "\t".join(["Delta_X", *["0,001000"] * 21]),
        "***End_of_Header***", "\t".join(names),
    ]  # fmt: skip
    forms = lambda t_s: "", lambda q: f"{q:.7f}", lambda i: f"{i:.7f}"
    path.write_text(lines(*head, *(row.replace(".", ",") for row in rows(log, "\t", forms))))


def oscilloscope(log, path):
    """Recorder with 21 channels: properties, V for all quantities."""
    names = ["TIME", *(f"CH{channel}" for channel in range(1, 22))]
    head = ["Model,ScopeCorder", "Sample Interval,1.000000E-03", f"Record Length,{len(log)}", "",
            ",".join(names), ",".join(["s", *["V"] * 21])]  # fmt: skip
    forms = (
        lambda t_s: f"{t_s - 0.5:.6E}", lambda q: f"{q / 1.047 + 2.5:.6f}", lambda i: f"{i / 2:.6f}",
    )  # fmt: skip
    path.write_text(lines(*head, *rows(log, ",", forms)))


def arduino(log, path):
    """Text of a serial port: the first and the last line are cut; counts of a converter and an encoder."""
    names = ["us", "a0", "a1", "encoder", *(f"i{group}" for group in GROUPS)]
    texts = [",".join(names)]
    for t_s, q, i in zip(log.t_s, log.angle_rad, log.current_A, strict=True):
        counts = [round(value * 12516 + 32768) for value in q[:2]] + [
            round(q[2] * 16384 / (2 * np.pi)) % 16384
        ]
        texts.append(
            ",".join([str(round(1e6 * t_s) + 52_000_104), *map(str, counts), *(f"{x:.4f}" for x in i)])
        )
    path.write_text(lines("0.0131,-0.0", *texts) + "53500104,32")


def excel(log, path):
    """Spreadsheet in German: semicolons, decimal commas, units in the names, dates."""
    names = [
        "Zeit",
        *(f"Winkel {axis} [°]" for axis in "αβγ"),
        *(f"Strom {1 + group} [mA]" for group in GROUPS),
    ]
    forms = (
        lambda t_s: f"{START + timedelta(seconds=round(t_s, 6)):%d.%m.%Y %H:%M:%S.%f}"[:-3],
        lambda q: f"{q * DEGREES:.6f}", lambda i: f"{1e3 * i:.3f}",
    )  # fmt: skip
    values = [row.replace(".", ",").replace(",11,2025", ".11.2025") for row in rows(log, ";", forms)]
    path.write_text(lines("sep=;", ";".join(names), *values), encoding="utf-8-sig")


FORMATS = {
    "ODrive": (odrive, "odrive.csv"), "SimpleFOC": (simplefoc, "simplefoc.txt"),
    "dSPACE": (dspace, "dspace.csv"), "Simulink": (simulink, "simulink.csv"),
    "ROS 2 bag": (ros_bag, "ros_bag.mcap"), "PlotJuggler": (plotjuggler, "plotjuggler.csv"),
    "LabVIEW": (labview, "labview.lvm"), "Oscilloscope": (oscilloscope, "oscilloscope.csv"),
    "Arduino": (arduino, "arduino.txt"), "Excel": (excel, "excel.csv"),
}  # fmt: skip
"""Writer and name of the file, by the heading of the page."""

MOST_LINES, LONGEST = 16, 88


def excerpt(path):
    """Beginning of a file, or the topics of one, as the page shows it."""
    if path.suffix == ".mcap":
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
        channels = summary.channels.values()
        counts = summary.statistics.channel_message_counts
        return lines(*(f"{one.topic}: {counts[one.id]} messages {joint_states.TYPE}" for one in channels))
    texts = path.read_text(encoding="utf-8-sig").splitlines()
    first = next(place for place, text in enumerate(texts) if text.count("0") > 10 or place == len(texts) - 1)
    shown = texts[: min(first + 3, MOST_LINES)]
    return lines(*(text if len(text) <= LONGEST else f"{text[:LONGEST]}…" for text in shown))
