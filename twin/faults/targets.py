"""Parts that can fail and the effects of their failure modes, one target for each kind of part."""

from spheretwin.electronics.coil import OPEN, SHORTED
from spheretwin.electronics.drive_chain import SILENT, STUCK
from spheretwin.electronics.transducers import Potentiometers
from spheretwin.faults.effects import (
    GAIN,
    INTERVAL,
    ActiveFault,
    Effects,
    FaultSignal,
    Mode,
    Target,
    Value,
    fix,
    offset_mode,
    signal_modes,
    silent_modes,
)


def _silence_adc(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.silent[:2] = 1


def _delay_adc(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.stages["adc"].delay_ticks += round(fault.value / effects.period_s)


ADC_SIGNAL = FaultSignal(
    lambda effects: effects.sensors.stages["adc"].line,
    "V",
    lambda effects: 1.0 / effects.sensors.stages["adc"].volts_per_rad,
    every_channel=True,
)

ADC = Target(
    "adc",
    {
        **signal_modes(ADC_SIGNAL),
        "dropout": Mode(_silence_adc),
        "delay": Mode(_delay_adc, Value("additional delay, s; whole control periods", 0.0, 1.0)),
        "intermittent": Mode(_silence_adc, INTERVAL, intermittent=True),
    },
    measured=True,
)


def _open_circuit(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.coil.contact[fault.place] = OPEN


AMPLIFIER_SIGNAL = FaultSignal(lambda effects: effects.drive.stages["amplifier"].line, "A")

AMPLIFIER = Target(
    "amplifier",
    {
        "open": Mode(_open_circuit),
        **signal_modes(AMPLIFIER_SIGNAL),
        **silent_modes(AMPLIFIER_SIGNAL),
    },
    each_group=True,
)


def _short_coil(effects: Effects, fault: ActiveFault) -> None:
    if (
        effects.drive.coil.contact[fault.place] != OPEN
    ):  # an open lead stays open, also if the coil behind it is shorted
        effects.drive.coil.contact[fault.place] = SHORTED


def _fewer_turns(effects: Effects, fault: ActiveFault) -> None:
    # Resistance and inductance stay: the change by a few turns is small compared with that of the torque.
    effects.group_gain[fault.place] *= fault.value


COIL = Target(
    "coil",
    {
        "open": Mode(_open_circuit),
        "short": Mode(_short_coil),
        "gain": Mode(
            _fewer_turns,
            Value("factor on torque and back-EMF per ampere: share of the turns that are left", 0.0, 1.0),
        ),
        "intermittent": Mode(_open_circuit, INTERVAL, intermittent=True),
    },
    each_group=True,
)


def _stick_output(effects: Effects, fault: ActiveFault) -> None:
    if effects.drive.output.state != SILENT:
        effects.drive.output.state = STUCK


def _silence_output(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.output.state = SILENT


def _delay_controller(effects: Effects, fault: ActiveFault) -> None:
    effects.drive.output.delay_steps += round(fault.value / effects.step_s)


CONTROLLER = Target(
    "controller",
    {
        "stuck": Mode(_stick_output),
        "dropout": Mode(_silence_output),
        "delay": Mode(
            _delay_controller, Value("additional delay of a command, s; whole physics steps", 0.0, 1.0)
        ),
        "intermittent": Mode(_stick_output, INTERVAL, intermittent=True),
    },
)


DAC_SIGNAL = FaultSignal(
    lambda effects: effects.drive.stages["dac"].line,
    "V",
    lambda effects: float(effects.drive.stages["dac"].dac.transconductance_A_V),
)

DAC = Target("dac", {**signal_modes(DAC_SIGNAL), **silent_modes(DAC_SIGNAL)}, each_group=True)


def _silence_encoder(effects: Effects, fault: ActiveFault) -> None:
    effects.sensors.silent[2] = 1


ENCODER = Target(
    "encoder",
    {
        **signal_modes(FaultSignal(lambda effects: effects.sensors.stages["encoder"].line, "rad")),
        "dropout": Mode(_silence_encoder),
        "intermittent": Mode(_silence_encoder, INTERVAL, intermittent=True),
    },
    places=("gamma",),
    measured=True,
)


def _stage(effects: Effects) -> Potentiometers:
    stage: Potentiometers = effects.sensors.stages["potentiometer"]
    return stage


def _open_potentiometer(effects: Effects, fault: ActiveFault) -> None:
    stage = _stage(effects)
    fix(stage.line, fault.place, fault.value / stage.volts_per_rad)


def _open_intermittently(effects: Effects, fault: ActiveFault) -> None:
    fix(_stage(effects).line, fault.place, 0.0)


def _short_potentiometer(effects: Effects, fault: ActiveFault) -> None:
    stage = _stage(effects)
    fix(stage.line, fault.place, stage.channels[0].half_angle_rad)


POTENTIOMETER = Target(
    "pot",
    {
        "open": Mode(
            _open_potentiometer, Value("voltage to which the input of the converter drifts, V", default=0.0)
        ),
        "short": Mode(_short_potentiometer),  # to the positive end of the track
        **signal_modes(FaultSignal(lambda effects: _stage(effects).line, "rad")),
        "intermittent": Mode(_open_intermittently, INTERVAL, intermittent=True),
    },
    places=("alpha", "beta"),
    measured=True,
)


SUPPLY_SIGNAL = FaultSignal(lambda effects: effects.drive.supply, "V")

_MODES = signal_modes(SUPPLY_SIGNAL)

SUPPLY = Target(
    "supply",
    {
        "offset": _MODES["offset"]._replace(value=offset_mode("V of either sign")),
        "gain": _MODES["gain"]._replace(value=GAIN._replace(least=0.0)),
        "noise": _MODES["noise"],
        **silent_modes(SUPPLY_SIGNAL),
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
