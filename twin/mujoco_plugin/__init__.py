"""MuJoCo plugin ``spheretwin.coils``: coils that turn the rotor in any MuJoCo program of this process.

Import it before a model with ``<plugin plugin="spheretwin.coils">`` is compiled:

>>> import mujoco
>>> import spheretwin.mujoco_plugin
>>> model = mujoco.MjModel.from_xml_path(str(spheretwin.mujoco_plugin.EXAMPLE))
>>> model.nu  # a control for each group
18
"""

from spheretwin.models.actuator import FOLDER
from spheretwin.mujoco_plugin.registration import register

EXAMPLE = FOLDER / "coils.xml"
"""Shipped actuator with group currents as controls and the sensors of the plugin."""

register()
