"""What our files hold, format 1: one msgspec Struct for each object in them, and the way to and from the
core's types.

The core does not know its files and the files not the core's checks: a Struct says which fields and what kind
of value, `core` makes the thing itself, whose own checks then apply. A corner is [id, x, y], a matrix a list
of rows, a lens its name in LENSES and its coefficients by name (one left out has its usual value), with the
displacement over it where it is a free lens. docs/conventions.md says what the numbers mean.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from orthoscope.fitting.calibration import Calibration, Candidate, Uncertainty, Variances
from orthoscope.formats.own.earlier import CandidateRow, candidate_in, settings_in
from orthoscope.formats.own.struct import FileStruct
from orthoscope.geometry.arrays import InputError, ndarray
from orthoscope.geometry.pose import Pose
from orthoscope.methods import check_settings
from orthoscope.models.camera import Camera
from orthoscope.models.intrinsics import Intrinsics
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.lens import Lens
from orthoscope.models.lenses.spline import Displacement, Lattice
from orthoscope.models.lenses.table import LENSES
from orthoscope.models.target_shape import TargetShape
from orthoscope.simulation.scene import Scene
from orthoscope.targets.board import Board
from orthoscope.targets.chessboard import Chessboard
from orthoscope.targets.detections import Detections, Outlier, Remark, SetAside, View
from orthoscope.targets.table import TARGETS, as_fields
from orthoscope.targets.target import Target, several

__all__ = ["CalibrationFile", "CameraFile", "DetectionsFile", "SceneFile"]

Row = list[float]


class TargetFile(FileStruct, kw_only=True):
    name: str
    grid: tuple[int, int] | None = None
    points: list[tuple[float, float, float]]
    lines: list[list[int]] = []
    board: dict[str, Any] | None = None  # a chessboard is known by its grid
    members: list[TargetFile] = []  # of several targets; points and lines then follow from theirs

    @classmethod
    def of(cls, target: Target) -> TargetFile:
        lines = [line.tolist() for line in target.lines]
        board = None if target.board is None or target.kind == Chessboard.kind else as_fields(target.board)
        return cls(
            name=target.name,
            grid=target.grid,
            points=target.points.tolist(),
            lines=lines,
            board=board,
            members=[cls.of(member) for member in target.members],
        )

    def core(self) -> Target:
        if self.members:
            return several([member.core() for member in self.members])
        points = np.array(self.points, dtype=float).reshape(-1, 3)
        lines = tuple(np.array(line, dtype=np.int64) for line in self.lines)
        return Target(self.name, points, lines, self.grid, _board(self.board) if self.board else None)


def _board(fields: dict[str, Any]) -> Board:
    kind, rest = fields.get("kind"), {name: value for name, value in fields.items() if name != "kind"}
    if kind not in TARGETS:
        raise InputError(f"a target of kind {kind!r} is not known; expected one of {', '.join(TARGETS)}.")
    return msgspec.convert(rest, TARGETS[kind])


class ViewFile(FileStruct):
    image: str
    corners: list[tuple[int, float, float]]

    @classmethod
    def of(cls, view: View) -> ViewFile:
        return cls(view.image, list(zip(view.ids.tolist(), *view.pixels.T.tolist(), strict=True)))

    def core(self) -> View:
        ids, *pixels = zip(*self.corners, strict=True) if self.corners else ((), (), ())
        return View(self.image, np.array(ids, dtype=np.int64), np.array(pixels, dtype=float).T)


class DetectionsFile(FileStruct):
    image_size: tuple[int, int]
    target: TargetFile
    views: list[ViewFile]
    set_aside: list[tuple[str, str]] = []
    outliers: list[tuple[str, int, tuple[float, float], str]] = []
    disc_centres: bool = False
    remarks: list[tuple[str, str]] = []

    @classmethod
    def of(cls, detections: Detections) -> DetectionsFile:
        return cls(
            detections.image_size,
            TargetFile.of(detections.target),
            [ViewFile.of(view) for view in detections.views],
            [(image, reason) for image, reason in detections.set_aside],
            [(image, corner, pixel, reason) for image, corner, pixel, reason in detections.outliers],
            detections.disc_centres,
            [(image, words) for image, words in detections.remarks],
        )

    def core(self) -> Detections:
        views = tuple(view.core() for view in self.views)
        aside, outliers = (
            tuple(SetAside(*entry) for entry in self.set_aside),
            tuple(Outlier(*entry) for entry in self.outliers),
        )
        remarks = tuple(Remark(*entry) for entry in self.remarks)
        return Detections(
            self.target.core(), self.image_size, views, aside, outliers, self.disc_centres, remarks
        )


class IntrinsicsFile(FileStruct, omit_defaults=False):
    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0

    def core(self) -> Intrinsics:
        return Intrinsics(self.fx, self.fy, self.cx, self.cy, self.skew)


class DisplacementFile(FileStruct):
    origin: Row
    step: Row
    shape: tuple[int, int]
    coefficients: list[Row]

    @classmethod
    def of(cls, over: Displacement) -> DisplacementFile:
        return cls(
            over.lattice.origin.tolist(),
            over.lattice.step.tolist(),
            over.lattice.shape,
            over.coefficients.tolist(),
        )

    def core(self) -> Displacement:
        return Displacement(
            Lattice(_array(self.origin), _array(self.step), self.shape), _array(self.coefficients)
        )


class LensFile(FileStruct):
    """A formula of LENSES; with a displacement `over` it, a free lens."""

    name: str
    coefficients: dict[str, float]
    over: DisplacementFile | None = None

    @classmethod
    def of(cls, lens: Lens) -> LensFile:
        if isinstance(lens, FreeLens):
            base = cls.of(lens.base)
            return cls(base.name, base.coefficients, DisplacementFile.of(lens.over))
        for name, kind in LENSES.items():
            if type(lens) is kind:
                return cls(name, dict(zip(lens.names(), lens.coefficients.tolist(), strict=True)))
        raise InputError(
            f"a lens of type {type(lens).__name__} cannot be saved; expected one of LENSES:"
            f" {', '.join(LENSES)}."
        )

    def core(self) -> Lens:
        if self.name not in LENSES:
            raise InputError(
                f"lens {self.name!r} is not known; expected one of {', '.join(LENSES)}. Upgrade orthoscope or"
                " mend the name."
            )
        formula = LENSES[self.name]().with_coefficients(**self.coefficients)
        return FreeLens(formula, self.over.core()) if self.over else formula


class CameraFile(FileStruct):
    image_size: tuple[int, int]
    intrinsics: IntrinsicsFile
    lens: LensFile
    lens_frame: IntrinsicsFile | None = None

    @classmethod
    def of(cls, camera: Camera) -> CameraFile:
        frame = camera.lens_frame and IntrinsicsFile(*camera.lens_frame.as_tuple())
        return cls(
            camera.image_size, IntrinsicsFile(*camera.intrinsics.as_tuple()), LensFile.of(camera.lens), frame
        )

    def core(self) -> Camera:
        return Camera(
            self.image_size,
            self.intrinsics.core(),
            self.lens.core(),
            self.lens_frame and self.lens_frame.core(),
        )


class PoseFile(FileStruct):
    rotation: tuple[Row, Row, Row]
    translation: Row

    @classmethod
    def of(cls, pose: Pose) -> PoseFile:
        return cls(pose.rotation.tolist(), pose.translation.tolist())

    def core(self) -> Pose:
        return Pose(_array(self.rotation), _array(self.translation))


class UncertaintyFile(FileStruct):
    names: list[str]
    covariance: list[Row]
    model: list[Row] | None = None

    @classmethod
    def of(cls, uncertainty: Uncertainty) -> UncertaintyFile:
        differs = bool((uncertainty.model != uncertainty.covariance).any())
        model = uncertainty.model.tolist() if differs else None
        return cls(list(uncertainty.names), uncertainty.covariance.tolist(), model)

    def core(self) -> Uncertainty:
        k = len(self.names)
        for matrix in (self.covariance, self.model or self.covariance):
            if len(matrix) != k or any(len(row) != k for row in matrix):
                raise InputError(
                    f"the covariance is not {k} by {k} though {k} parameters are named; expected a row and a"
                    " column for each."
                )
        return Uncertainty(tuple(self.names), _array(self.covariance), _array(self.model or self.covariance))


class TargetShapeFile(FileStruct):
    kind: str
    displacements: list[Row]

    @classmethod
    def of(cls, shape: TargetShape) -> TargetShapeFile:
        return cls(shape.kind, shape.displacements.tolist())

    def core(self) -> TargetShape:
        return TargetShape(self.kind, _array(self.displacements).reshape(-1, 3))


class CandidateFile(FileStruct):
    """JSON has no NaN: null says that nothing could judge."""

    target: str
    lens: str
    base: str
    fit: str
    views: int
    held_out_px: float | None
    standard_error_px: float | None
    loses_px: float | None

    @classmethod
    def of(cls, candidate: Candidate) -> CandidateFile:
        told = (candidate.held_out_px, candidate.standard_error_px, candidate.loses_px)
        figures = (value if np.isfinite(value) else None for value in told)
        return cls(candidate.target, candidate.lens, candidate.base, candidate.fit, candidate.views, *figures)

    def core(self) -> Candidate:
        held_out, error, loses = (
            float("nan") if value is None else value
            for value in (self.held_out_px, self.standard_error_px, self.loses_px)
        )
        return Candidate(self.target, self.lens, held_out, error, loses, self.base, self.fit, self.views)


class VariancesFile(FileStruct):
    noise: float
    surface: tuple[float, float]
    singles: tuple[float, float, float]
    bend: float
    size: float
    likeness: float

    def core(self) -> Variances:
        return Variances(self.noise, self.surface, self.singles, self.bend, self.size, self.likeness)


class CalibrationFile(FileStruct, kw_only=True):
    version: str
    camera: CameraFile
    uncertainty: UncertaintyFile
    status: str
    steps: int
    method: str
    settings: dict[str, Any]
    assumptions: list[str] = []
    parameters: float | None = None
    candidates: list[CandidateFile | CandidateRow] = []
    variances: VariancesFile | None = None
    free_camera: CameraFile | None = None
    camera_from_target: list[PoseFile]
    target_shape: TargetShapeFile | None = None
    detections: DetectionsFile

    @classmethod
    def of(cls, calibration: Calibration) -> CalibrationFile:
        return cls(
            version=calibration.version,
            method=calibration.method,
            settings=dict(calibration.settings),
            status=calibration.status,
            steps=calibration.steps,
            camera=CameraFile.of(calibration.camera),
            uncertainty=UncertaintyFile.of(calibration.uncertainty),
            camera_from_target=[PoseFile.of(pose) for pose in calibration.camera_from_target],
            detections=DetectionsFile.of(calibration.detections),
            assumptions=list(calibration.assumptions),
            parameters=calibration.parameters,
            candidates=[CandidateFile.of(candidate) for candidate in calibration.candidates],
            variances=calibration.variances and VariancesFile(*calibration.variances),
            free_camera=calibration.free_camera and CameraFile.of(calibration.free_camera),
            target_shape=(
                None
                if calibration.target_shape.kind == "flat"
                else TargetShapeFile.of(calibration.target_shape)
            ),
        )

    def core(self) -> Calibration:
        settings = settings_in(self.method, self.settings)
        check_settings(self.method, settings)
        return Calibration(
            camera=self.camera.core(),
            camera_from_target=tuple(pose.core() for pose in self.camera_from_target),
            detections=self.detections.core(),
            method=self.method,
            settings=settings,
            uncertainty=self.uncertainty.core(),
            status=self.status,
            steps=self.steps,
            version=self.version,
            assumptions=tuple(self.assumptions),
            parameters=float("nan") if self.parameters is None else self.parameters,
            candidates=tuple(
                candidate_in(candidate, settings) if isinstance(candidate, tuple) else candidate.core()
                for candidate in self.candidates
            ),
            variances=self.variances and self.variances.core(),
            free_camera=self.free_camera and self.free_camera.core(),
            **({"target_shape": self.target_shape.core()} if self.target_shape else {}),
        )


class SceneFile(FileStruct):
    camera: CameraFile
    target: TargetFile
    camera_from_target: list[PoseFile]

    @classmethod
    def of(cls, scene: Scene) -> SceneFile:
        return cls(
            CameraFile.of(scene.camera),
            TargetFile.of(scene.target),
            [PoseFile.of(pose) for pose in scene.camera_from_target],
        )

    def core(self) -> Scene:
        return Scene(
            self.camera.core(), self.target.core(), tuple(pose.core() for pose in self.camera_from_target)
        )


def _array(rows: Any) -> ndarray:
    return np.array(rows, dtype=float)
