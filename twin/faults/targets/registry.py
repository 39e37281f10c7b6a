"""All kinds of parts that can fail, in the order of the telemetry.

A new one is a file and a row.
"""

from spheretwin.twin.faults.target import Target
from spheretwin.twin.faults.targets import adc, amplifier, coil, controller, dac, encoder, pot, supply

TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        coil.TARGET,
        amplifier.TARGET,
        dac.TARGET,
        pot.TARGET,
        encoder.TARGET,
        adc.TARGET,
        supply.TARGET,
        controller.TARGET,
    )
}
