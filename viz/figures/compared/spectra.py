"""Spectra of tracking errors: a panel a hinge, a line a run, a dot a peak."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.compared.run import Run
from spheretwin.viz.compared.spectrum import Spectrum
from spheretwin.viz.compared.thinning import highest_by_octave
from spheretwin.viz.figures.compared.style import looks, name_runs, plain
from spheretwin.viz.figures.plots import WIDTH_in

LINES_EACH_OCTAVE = 64


def spectra(runs: Sequence[Run], of_runs: Sequence[Sequence[Spectrum]], title: str) -> Figure:
    """Draw them, both axes logarithmic.

    Parameters
    ----------
    runs : sequence of Run
    of_runs : sequence of sequence of Spectrum
        Of each run, of each hinge.
    title : str
    """
    figure = Figure(figsize=(WIDTH_in, 7.0), layout="constrained")
    panels = figure.subplots(len(ANGLES), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (panel, name) in enumerate(zip(panels, ANGLES, strict=True)):
        panel.set_xscale("log")
        panel.set_yscale("log")
        for run, look, of_run in zip(runs, looks(runs), of_runs, strict=True):
            spectrum = of_run[axis]
            lines = highest_by_octave(spectrum.frequency_Hz, spectrum.amplitude_mrad, LINES_EACH_OCTAVE)
            panel.plot(*lines, label=run.label, **look.line())
            for frequency_Hz, amplitude_mrad in spectrum.peaks:
                panel.plot(frequency_Hz, amplitude_mrad, "o", color=look.colour, markersize=4)
        plain(panel, f"error of {name},\namplitude, mrad")
    panels[0].set_title(title, fontsize="medium")
    panels[-1].set_xlabel("frequency, Hz")
    name_runs(figure, panels[0])
    return figure
