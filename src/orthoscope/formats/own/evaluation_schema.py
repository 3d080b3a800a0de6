"""What `evaluation.json` holds: every number and sentence of an Evaluation, and the camera that was judged.

The calibration itself stands in its own file; the camera is told again so that the two can be seen to belong
together, and so that a program that reads this file alone knows what was judged. Deviations are the standard
deviations of the camera's parameters that were estimated, by their names; null where one is open. Held-out
residuals are a row [x, y] for each corner, in the order of the calibration's views and their corners; folds
is in how many parts the views were held out, 0 for each in its turn, and five where an earlier file does not
say.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import msgspec

from orthoscope.evaluation.camera_error import CameraError
from orthoscope.evaluation.disagreement import Disagreement
from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.evaluation.groups import Groups
from orthoscope.evaluation.misfit.f_test import MisfitTest
from orthoscope.evaluation.misfit.misfit import LensMisfit, Misfit, TargetMisfit
from orthoscope.evaluation.suspects import ViewError
from orthoscope.evaluation.verdict.situation import Situation
from orthoscope.evaluation.verdict.verdict import verdict_on
from orthoscope.fitting.calibration import Calibration
from orthoscope.fitting.unseen.held_out import USUAL_FOLDS
from orthoscope.formats.own.schema import CameraFile
from orthoscope.formats.own.struct import FileStruct, Number, Record, array_of, null_for_nan, rows_of
from orthoscope.geometry.arrays import InputError
from orthoscope.geometry.cells import Cells

__all__ = ["EvaluationFile"]


class ViewErrorFile(Record):
    CORE: ClassVar[type] = ViewError
    image: str
    corners: int
    rms_px: Number
    held_out_rms_px: Number


class MisfitTestFile(Record):
    CORE: ClassVar[type] = MisfitTest
    f: Number
    between: Number
    within: Number
    chance: Number
    p_value: Number
    p_over_views: Number
    systematic_px: Number
    noise_px: Number


class TargetMisfitFile(FileStruct):
    test: MisfitTestFile
    pixels_per_metre: Number
    moves_camera_px: Number
    displacements: list[list[Number]]

    @classmethod
    def of(cls, found: TargetMisfit) -> TargetMisfitFile:
        return cls(
            MisfitTestFile.of(found.test),
            null_for_nan(found.pixels_per_metre),
            null_for_nan(found.moves_camera_px),
            rows_of(found.displacements),
        )

    def core(self) -> TargetMisfit:
        per_metre, moves = (
            float("nan") if number is None else number
            for number in (self.pixels_per_metre, self.moves_camera_px)
        )
        return TargetMisfit(self.test.core(), array_of(self.displacements, -1, 3), per_metre, moves)


class LensMisfitFile(FileStruct):
    test: MisfitTestFile
    columns: int
    rows: int
    residuals: list[list[Number]]

    @classmethod
    def of(cls, found: LensMisfit) -> LensMisfitFile:
        test, cells = MisfitTestFile.of(found.test), found.cells
        return cls(test, cells.columns, cells.rows, rows_of(found.residuals.reshape(-1, 2)))

    def core(self, image_size: tuple[int, int]) -> LensMisfit:
        cells = Cells(image_size, self.columns, self.rows)
        return LensMisfit(self.test.core(), cells, array_of(self.residuals, self.rows, self.columns, 2))


class CameraErrorFile(FileStruct):
    """The maps are rows of the frame, top to bottom; the region is a polygon of pixels."""

    seen_px: Number
    frame_px: Number
    near_seen_px: Number
    near_frame_px: Number
    model_px: Number
    alike_px: Number
    views_px: Number
    bias_px: Number
    distance: Number
    limit_px: Number
    far: list[list[Number]]
    near: list[list[Number]]
    region: list[tuple[float, float]]
    without_px: list[Number] = []
    share: Number = None
    seen_share: Number = None

    @classmethod
    def of(cls, error: CameraError) -> CameraErrorFile:
        numbers = {name: null_for_nan(getattr(error, name)) for name in cls._numbers()}
        region = [(float(x), float(y)) for x, y in error.region]
        without = rows_of(error.without_px)
        return cls(
            far=rows_of(error.far), near=rows_of(error.near), region=region, without_px=without, **numbers
        )

    def core(self) -> CameraError:
        numbers: dict[str, Any] = {
            name: float("nan") if getattr(self, name) is None else getattr(self, name)
            for name in self._numbers()
        }
        far, near = (array_of(rows, len(rows), -1) for rows in (self.far, self.near))
        region, without = array_of(list(self.region), -1, 2), array_of(self.without_px, -1)
        return CameraError(far=far, near=near, region=region, without_px=without, **numbers)

    @classmethod
    def _numbers(cls) -> list[str]:
        return [field.name for field in msgspec.structs.fields(cls) if field.type == Number]


class DisagreementFile(Record):
    """What each view would have liked is not kept."""

    CORE: ClassVar[type] = Disagreement
    f2: Number
    p_value: Number
    certain: bool
    kind: str
    by_px: Number
    focal: Number
    centre_px: Number


class SituationFile(Record):
    """The facts that the verdict is made from."""

    CORE: ClassVar[type] = Situation
    method: str
    lens: str
    shape: str
    base: str
    first_lens: str
    views: int
    distinct: int
    converged: bool
    error_px: Number
    coarse_px: Number
    share: Number
    covered: Number
    place: str
    noise_px: Number
    tilt: Number
    corners: int
    wild: int
    loss: str
    beyond: int
    fold: Number
    disagree: str
    differ_px: Number
    differ_focal: Number
    differ_centre_px: Number
    groups: tuple[tuple[str, ...], ...]
    lens_px: Number
    target_px: Number
    target_mm: Number
    suspects: tuple[tuple[str, str], ...]
    precious: tuple[tuple[str, str], ...]
    near_px: Number = None
    centre_sd: float = 0.0
    wild_in: tuple[str, ...] = ()


class GroupsFile(Record):
    CORE: ClassVar[type] = Groups
    first: tuple[int, ...]
    second: tuple[int, ...]
    unsure: tuple[int, ...]


class EvaluationFile(FileStruct, kw_only=True):
    version: str
    verdict: str
    grade: str
    cause: str = ""
    situation: SituationFile
    error: CameraErrorFile | None
    disagreement: DisagreementFile
    groups: GroupsFile | None
    warnings: list[str]
    rms_px: Number
    median_px: Number
    largest_px: Number
    held_out_rms_px: Number
    held_out_error_px: Number
    nce: Number
    coverage: Number
    suspects: list[tuple[str, str]] = []
    views: list[ViewErrorFile]
    camera: CameraFile
    deviations: dict[str, Number] = {}
    target_misfit: TargetMisfitFile
    lens_misfit: LensMisfitFile
    held_out_residuals: list[list[list[Number]]]
    folds: int = USUAL_FOLDS

    @classmethod
    def of(cls, evaluation: Evaluation) -> EvaluationFile:
        return cls(
            version=evaluation.calibration.version,
            camera=CameraFile.of(evaluation.calibration.camera),
            deviations={
                name: deviation if math.isfinite(deviation) else None
                for name, deviation in evaluation.calibration.uncertainty.deviations.items()
            },
            views=[ViewErrorFile.of(view) for view in evaluation.views],
            target_misfit=TargetMisfitFile.of(evaluation.misfit.target),
            lens_misfit=LensMisfitFile.of(evaluation.misfit.lens),
            held_out_residuals=[rows_of(residuals) for residuals in evaluation.held_out_residuals],
            suspects=list(evaluation.suspects),
            warnings=list(evaluation.warnings),
            verdict=str(evaluation.verdict),
            grade=str(evaluation.verdict.grade),
            cause=evaluation.verdict.cause,
            situation=SituationFile.of(evaluation.situation),
            error=CameraErrorFile.of(evaluation.error) if evaluation.error else None,
            disagreement=DisagreementFile.of(evaluation.disagreement),
            groups=GroupsFile.of(evaluation.groups) if evaluation.groups else None,
            folds=evaluation.folds,
            **{name: null_for_nan(getattr(evaluation, name)) for name in NUMBER_FIELDS},
        )

    def core(self, calibration: Calibration) -> Evaluation:
        """The evaluation of this calibration.

        Raises:
            InputError: it was made of another calibration.
        """
        detections = calibration.detections
        corners = [(view.image, len(view.ids)) for view in detections.views]
        if CameraFile.of(calibration.camera) != self.camera or corners != [
            (view.image, view.corners) for view in self.views
        ]:
            raise InputError("it judges another camera than the calibration's; evaluate that one anew")
        if len(self.held_out_residuals) != len(self.views):
            raise InputError(f"it has not {len(self.views)} tables of held-out residuals, one for each view")
        situation = self.situation.core()
        numbers: dict[str, Any] = {
            name: float("nan") if getattr(self, name) is None else getattr(self, name)
            for name in NUMBER_FIELDS
        }
        return Evaluation(
            calibration=calibration,
            misfit=Misfit(self.target_misfit.core(), self.lens_misfit.core(detections.image_size)),
            views=tuple(view.core() for view in self.views),
            held_out_residuals=tuple(
                array_of(rows, view.corners, 2)
                for rows, view in zip(self.held_out_residuals, self.views, strict=True)
            ),
            suspects=tuple(self.suspects),
            warnings=tuple(self.warnings),
            verdict=verdict_on(situation),
            error=self.error.core() if self.error else None,
            disagreement=self.disagreement.core(),
            groups=self.groups.core() if self.groups else None,
            situation=situation,
            folds=self.folds,
            **numbers,
        )


# These fields are one number each, here and in the core.
NUMBER_FIELDS = tuple(name for name, kind in EvaluationFile.__annotations__.items() if kind == "Number")
