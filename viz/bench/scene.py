"""Scene of the bench: the moving actuator, its coils in the colours of their currents."""

from __future__ import annotations

from collections import deque
from math import pi

import numpy as np
import viser
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from spheretwin.models.actuator import Actuator
from spheretwin.viz import theme
from spheretwin.viz.bench.actuator import actuator_solids, quaternions_along
from spheretwin.viz.bench.protocols import Bins
from spheretwin.viz.scene.solids import Surface

LIGHT = 1.6
"""Light of a surface that appears in its own colour, relative to the light that makes white appear white."""

# The end of the curve is cut: the difference is invisible, and a bright colour remains a colour.
BRIGHTEST = 0.9

_EXPOSURE = 1 / 0.6
_INTO = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
_OUT_OF = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)


def instance_colours(colours: ArrayLike) -> NDArray[np.uint8]:
    """Colours of many copies of a solid, (..., 3), which a page takes for shares of light."""
    return np.round(255 * _albedo(colours)).astype(np.uint8)


def mesh_colour(colour: ArrayLike) -> tuple[int, int, int]:
    """Colour of one solid, which a page takes as a screen does."""
    red, green, blue = np.round(255 * _encoded(_albedo(colour))).astype(int).tolist()
    return red, green, blue


def _albedo(colours: ArrayLike) -> NDArray[np.float64]:
    """Share of the light that a surface gives back, (..., 3)."""
    shown = np.clip(theme.linear_light(np.asarray(colours) / 255) @ np.linalg.inv(_OUT_OF).T, 0.0, BRIGHTEST)
    # v (v + 0.0245786) - 0.000090537 = shown (v (0.983729 v + 0.4329510) + 0.238081)
    a, b, c = (
        1 - 0.983729 * shown,
        0.0245786 - 0.4329510 * shown,
        -0.000090537 - 0.238081 * shown,
    )
    before = (-b + np.sqrt(b**2 - 4 * a * c)) / (2 * a)
    return np.clip(before @ np.linalg.inv(_INTO).T / (_EXPOSURE * LIGHT), 0.0, 1.0)


def _encoded(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


STEEL = (150, 156, 166)
FRAME = (70, 76, 86)
BALL = (196, 200, 206)
# Muted, compared with the colours of the currents.
NORTH, SOUTH = (120, 72, 70), (72, 82, 112)
GHOST_OPACITY = 0.3

# Share of the ball's radius.
TIP_RADIUS = 0.12

# Points of the path of the tip: 50 a second, as the bins of the history.
TRAIL_POINTS = 150

SMALLEST_M = 1e-9


class Scene:
    """Scene of the bench: moving bodies, coil colours, and the handle that can be dragged.

    Parameters
    ----------
    api : viser.SceneApi
        Scene in which it is drawn, in metres.
    actuator : Actuator
        Actuator that is drawn.

    Attributes
    ----------
    coils : viser.BatchedMeshHandle
        One instance a coil, in the order of the actuator's.
    handle : viser.IcosphereHandle
        The tip of the desired pose, to be dragged.
    trail_after : int
        Number of the last bin of the path of the tip.
    """

    def __init__(self, api: viser.SceneApi, actuator: Actuator) -> None:
        self._actuator = actuator
        parts = actuator_solids(actuator)
        _light(api)
        api.world_axes.visible = False
        _mesh(api, "/stator", parts.stator, FRAME)
        self._hinges = [api.add_frame(name, show_axes=False) for name in _HINGES]
        _mesh(api, f"{_HINGES[0]}/ring", parts.outer_ring, STEEL)
        _mesh(api, f"{_HINGES[1]}/ring", parts.inner_ring, STEEL)
        rotor = _HINGES[2]
        _mesh(api, f"{rotor}/ball", parts.rotor, BALL)
        shaft = quaternions_along(_unit(actuator.shaft_tip_m))[0]
        _mesh(api, f"{rotor}/shaft", parts.shaft, STEEL, wxyz=shaft)
        api.add_batched_meshes_simple(
            f"{rotor}/poles",
            parts.pole.positions,
            parts.pole.triangles,
            batched_wxyzs=quaternions_along(actuator.pole_axes),
            batched_positions=np.zeros((len(actuator.pole_axes), 3)),
            batched_colors=instance_colours(np.where(actuator.pole_polarity[:, None] > 0, NORTH, SOUTH)),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self.coils = api.add_batched_meshes_simple(
            "/coils",
            parts.coil.positions,
            parts.coil.triangles,
            batched_wxyzs=quaternions_along(actuator.coil_axes),
            batched_positions=actuator.coil.distance_m * actuator.coil_axes,
            batched_colors=self._coil_colours(np.zeros(len(actuator.groups)), 1.0),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self._ghost = api.add_frame("/desired", show_axes=False)
        _mesh(api, "/desired/shaft", parts.shaft, theme.TRACE, wxyz=shaft, opacity=GHOST_OPACITY)
        self.handle = api.add_icosphere(
            "/tip",
            radius=TIP_RADIUS * actuator.magnet.front_m,
            subdivisions=2,
            color=mesh_colour(theme.TRACE),
            cast_shadow=False,
            receive_shadow=False,
        )
        self._trail_run, self.trail_after = -1, -1
        self._trail: deque[NDArray[np.float64]] = deque(maxlen=TRAIL_POINTS)
        self._line = api.add_line_segments(
            "/trail",
            np.zeros((1, 2, 3), dtype=np.float32),
            theme.TRACE,
            thickness=2.0,
            thickness_units="screen",
        )

    def move(
        self,
        q_rad: NDArray[np.float64],
        desired_rad: NDArray[np.float64] | None,
        current_A: NDArray[np.float64],
        limit_A: float,
    ) -> None:
        """Show a pose, the desired pose, and the currents.

        Parameters
        ----------
        q_rad : (3,) array, rad
            Hinge angles.
        desired_rad : (3,) array, rad, optional
            Desired hinge angles; the desired pose is hidden unless given.
        current_A : (n,) array, A
            Currents of the groups.
        limit_A : float, A
            Current of the full colour.
        """
        for axis, hinge in enumerate(self._hinges):
            hinge.wxyz = Rotation.from_euler("xyz"[axis], q_rad[axis]).as_quat(scalar_first=True)
        coloured = self._coil_colours(current_A, limit_A)
        if not np.array_equal(coloured, self.coils.batched_colors):
            self.coils.batched_colors = coloured
        self._ghost.visible = self.handle.visible = desired_rad is not None
        if desired_rad is not None:
            desired = _pose(desired_rad)
            self._ghost.wxyz = desired.as_quat(scalar_first=True)
            self.handle.position = desired.as_matrix() @ self._actuator.shaft_tip_m

    def trail(self, bins: Bins) -> None:
        """Extend the path of the tip by the first rows of bins; start again with another run."""
        if bins.run != self._trail_run:
            self._trail_run, self.trail_after = bins.run, -1
            self._trail.clear()
            self._line.points = np.zeros((1, 2, 3), dtype=np.float32)
            return  # of these bins some may be missing
        new = _pose(bins.rows["q_rad"][-TRAIL_POINTS:]).as_matrix() @ self._actuator.shaft_tip_m
        if not len(new):
            return
        self.trail_after = bins.numbers[-1]
        self._trail.extend(new)
        points = np.array(self._trail, dtype=np.float32)
        if len(points) > 1:
            self._line.points = np.stack([points[:-1], points[1:]], axis=1)

    def pose_under(
        self, point_m: tuple[float, float, float], eye_m: NDArray[np.float64], gamma_rad: float
    ) -> list[float]:
        """Hinge angles, rad, that bring the tip under a pointer; for a tip on the rotor's z.

        Parameters
        ----------
        point_m : (3,) floats, m
            Position of the pointer, at any depth.
        eye_m : (3,) array, m
            Position of the camera.
        gamma_rad : float, rad
            Angle about the shaft, which a pointer does not determine.
        """
        ahead = np.array(point_m) - eye_m
        ahead /= max(float(np.linalg.norm(ahead)), SMALLEST_M)
        reach_m = float(np.linalg.norm(self._actuator.shaft_tip_m))
        middle = float(eye_m @ ahead)
        # First intersection of the line of sight with the tip's sphere; if there is none, the closest point.
        half = np.sqrt(max(0.0, middle**2 - float(eye_m @ eye_m) + reach_m**2))
        met = eye_m + (-middle - half if middle < -half else half - middle) * ahead
        x, y, z = met / max(float(np.linalg.norm(met)), SMALLEST_M)
        return [float(np.arctan2(-y, z)), float(np.arcsin(np.clip(x, -1.0, 1.0))), gamma_rad]

    def _coil_colours(self, current_A: NDArray[np.float64], limit_A: float) -> NDArray[np.uint8]:
        of_group = instance_colours(theme.current_colours(current_A, limit_A))
        coloured = np.empty((len(self._actuator.coil_axes), 3), dtype=np.uint8)
        coloured[self._actuator.groups] = of_group[:, None, :]
        return coloured


_HINGES = ("/alpha", "/alpha/beta", "/alpha/beta/gamma")


def _light(api: viser.SceneApi) -> None:
    """Add few lights, without shadows and reflections: these cost half of the frames without a GPU."""
    api.configure_default_lights(enabled=False)
    api.configure_environment_map(None)
    api.add_light_ambient("/light/all", intensity=AMBIENT * pi * LIGHT)
    for name, intensity, position in _LAMPS:
        api.add_light_directional(
            f"/light/{name}", intensity=intensity * pi * LIGHT, position=position, cast_shadow=False
        )


# Shares of the light in which a surface has its own colour; a matt one gives a π-th of light back each way.
AMBIENT = 0.45
_LAMPS = (("key", 0.75, (0.6, -0.8, 1.0)), ("fill", 0.3, (-1.0, 0.3, 0.4)))


def _mesh(
    api: viser.SceneApi,
    name: str,
    surface: Surface,
    colour: theme.Colour,
    wxyz: NDArray[np.float64] | tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
    opacity: float | None = None,
) -> None:
    api.add_mesh_simple(
        name,
        surface.positions,
        surface.triangles,
        color=mesh_colour(colour),
        wxyz=wxyz,
        opacity=opacity,
        cast_shadow=False,
        receive_shadow=False,
    )


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector[None] / np.linalg.norm(vector)


def _pose(q_rad: NDArray[np.float64]) -> Rotation:
    """Rotation by three hinge angles: about x, then the turned y, then the turned z."""
    return Rotation.from_euler("XYZ", q_rad)
