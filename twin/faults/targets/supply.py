"""The supply of all amplifiers: gone, low, or with a ripple; what is left of it limits every group."""

from spheretwin.twin.faults.target import GAIN, STRETCH, Effects, Mode, Strike, Target, noise, offset


def _drop(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.supply[:] = 0.0


def _shift(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.supply[1] += strike.value


def _scale(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.supply[:] *= abs(strike.value)


def _noise(effects: Effects, strike: Strike) -> None:
    effects.drive.acts[0] = True
    effects.drive.supply[2] = (effects.drive.supply[2] ** 2 + strike.value**2) ** 0.5
    effects.drive.supply_column[0] = strike.column


TARGET = Target(
    "supply",
    {
        "offset": Mode(_shift, offset("V of either sign")),
        "gain": Mode(_scale, GAIN._replace(least=0.0)),
        "noise": Mode(_noise, noise("V")),
        "dropout": Mode(_drop),
        "intermittent": Mode(_drop, STRETCH, intermittent=True),
    },
    needs_supply=True,
)
