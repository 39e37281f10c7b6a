"""The converter of the potentiometers' voltages: held, shifted, scaled, noisy, silent or late."""

from spheretwin.electronics.coil import OPEN, SHORTED
from spheretwin.electronics.drive_chain import HANGING, SILENT
from spheretwin.electronics.transducers import Potentiometers
from spheretwin.faults import effects as line_modes
from spheretwin.faults.effects import (
    GAIN,
    STRETCH,
    ActiveFault,
    Effects,
    Mode,
    Signal,
    Target,
    Value,
    offset_mode,
)


def _silence_adc(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.silent[:2] = True


def _delay_adc(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.stage("adc").late_ticks[0] += round(fault.value / effects.period_s)


ADC_SIGNAL = Signal(
    lambda effects: effects.sensors.stage("adc").line,
    "V",
    lambda effects: 1.0 / effects.sensors.stage("adc").volts_per_rad,
    every_channel=True,
)

ADC = Target(
    "adc",
    {
        **line_modes.modes(ADC_SIGNAL),
        "dropout": Mode(_silence_adc),
        "delay": Mode(_delay_adc, Value("how late it is, s; whole control periods", 0.0, 1.0)),
        "intermittent": Mode(_silence_adc, STRETCH, intermittent=True),
    },
    measured=True,
)


def _open_amplifier(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.coil.contact[fault.place] = OPEN


AMPLIFIER_SIGNAL = Signal(lambda effects: effects.drive.stage("amplifier").line, "A")

AMPLIFIER = Target(
    "amplifier",
    {
        "open": Mode(_open_amplifier),
        **line_modes.modes(AMPLIFIER_SIGNAL),
        **line_modes.silent_modes(AMPLIFIER_SIGNAL),
    },
    each_group=True,
)


def _open_coil(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.coil.contact[fault.place] = OPEN


def _short_coil(effects: Effects, fault: ActiveFault) -> None:
    if effects.drive.coil.contact[fault.place] != OPEN:  # an open lead stays open, whatever lies behind it
        effects.drive.coil.contact[fault.place] = SHORTED


def _fewer_turns(effects: Effects, fault: ActiveFault) -> None:
    # Resistance and inductance stay: a few turns change them less than the torque of the others matters.
    effects.group_gain[fault.place] *= fault.value


COIL = Target(
    "coil",
    {
        "open": Mode(_open_coil),
        "short": Mode(_short_coil),
        "gain": Mode(
            _fewer_turns, Value("factor on torque and back-EMF an ampere: turns that are left", 0.0, 1.0)
        ),
        "intermittent": Mode(_open_coil, STRETCH, intermittent=True),
    },
    each_group=True,
)


def _hang(effects: Effects, fault: ActiveFault) -> None:
    if effects.drive.output.leaves[0] != SILENT:
        effects.drive.output.leaves[0] = HANGING


def _silence_controller(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.output.leaves[0] = SILENT


def _delay_controller(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.output.late_steps[0] += round(fault.value / effects.step_s)


CONTROLLER = Target(
    "controller",
    {
        "stuck": Mode(_hang),
        "dropout": Mode(_silence_controller),
        "delay": Mode(
            _delay_controller, Value("how much later a command is in force, s; whole physics steps", 0.0, 1.0)
        ),
        "intermittent": Mode(_hang, STRETCH, intermittent=True),
    },
)


DAC_SIGNAL = Signal(
    lambda effects: effects.drive.stage("dac").line,
    "V",
    lambda effects: float(effects.drive.stage("dac").dac.transconductance_A_V),
)

DAC = Target("dac", {**line_modes.modes(DAC_SIGNAL), **line_modes.silent_modes(DAC_SIGNAL)}, each_group=True)


def _silence_encoder(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.silent[2] = True


ENCODER = Target(
    "encoder",
    {
        **line_modes.modes(Signal(lambda effects: effects.sensors.stage("encoder").line, "rad")),
        "dropout": Mode(_silence_encoder),
        "intermittent": Mode(_silence_encoder, STRETCH, intermittent=True),
    },
    places=("gamma",),
    measured=True,
)


def _stage(effects: Effects) -> Potentiometers:
    stage: Potentiometers = effects.sensors.stage("potentiometer")
    return stage


def _open_potentiometer(effects: Effects, fault: ActiveFault) -> None:
    stage = _stage(effects)
    line_modes.fix(stage.line, fault.place, fault.value / stage.volts_per_rad)


def _open_now_and_then(effects: Effects, fault: ActiveFault) -> None:
    line_modes.fix(_stage(effects).line, fault.place, 0.0)


def _short_potentiometer(effects: Effects, fault: ActiveFault) -> None:
    stage = _stage(effects)
    line_modes.fix(stage.line, fault.place, stage.channels[0].half_angle_rad)


POTENTIOMETER = Target(
    "pot",
    {
        "open": Mode(_open_potentiometer, Value("what the converter's input drifts to, V", default=0.0)),
        "short": Mode(_short_potentiometer),  # to the positive end of the track
        **line_modes.modes(Signal(lambda effects: _stage(effects).line, "rad")),
        "intermittent": Mode(_open_now_and_then, STRETCH, intermittent=True),
    },
    places=("alpha", "beta"),
    measured=True,
)


SUPPLY_SIGNAL = Signal(lambda effects: effects.drive.supply, "V")

_MODES = line_modes.modes(SUPPLY_SIGNAL)

SUPPLY = Target(
    "supply",
    {
        "offset": _MODES["offset"]._replace(value=offset_mode("V of either sign")),
        "gain": _MODES["gain"]._replace(value=GAIN._replace(least=0.0)),
        "noise": _MODES["noise"],
        **line_modes.silent_modes(SUPPLY_SIGNAL),
    },
    needs_supply=True,
)


TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        COIL,
        AMPLIFIER,
        DAC,
        POTENTIOMETER,
        ENCODER,
        ADC,
        SUPPLY,
        CONTROLLER,
    )
}
