"""What `evaluation.json` holds: every number and sentence of an Evaluation, and the camera that was judged.

The calibration itself stands in its own file; the camera is told again so that the two can be seen to belong
together, and so that a program that reads this file alone knows what was judged. Held-out residuals are a row
[x, y] for each corner, in the order of the calibration's views and their corners.
"""

from __future__ import annotations

from typing import Any, ClassVar

from orthoscope.evaluation.evaluate import Evaluation
from orthoscope.evaluation.misfit.f_test import MisfitTest
from orthoscope.evaluation.misfit.misfit import LensMisfit, Misfit, TargetMisfit
from orthoscope.evaluation.verdict import ViewError
from orthoscope.fitting.calibration import Calibration
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


class EvaluationFile(FileStruct, kw_only=True):
    version: str
    verdict: str
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
    target_misfit: TargetMisfitFile
    lens_misfit: LensMisfitFile
    held_out_residuals: list[list[list[Number]]]

    @classmethod
    def of(cls, evaluation: Evaluation) -> EvaluationFile:
        return cls(
            version=evaluation.calibration.version,
            camera=CameraFile.of(evaluation.calibration.camera),
            views=[ViewErrorFile.of(view) for view in evaluation.views],
            target_misfit=TargetMisfitFile.of(evaluation.misfit.target),
            lens_misfit=LensMisfitFile.of(evaluation.misfit.lens),
            held_out_residuals=[rows_of(residuals) for residuals in evaluation.held_out_residuals],
            suspects=list(evaluation.suspects),
            warnings=list(evaluation.warnings),
            verdict=evaluation.verdict,
            **{name: null_for_nan(getattr(evaluation, name)) for name in NUMBERS},
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
        numbers: dict[str, Any] = {
            name: float("nan") if getattr(self, name) is None else getattr(self, name) for name in NUMBERS
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
            verdict=self.verdict,
            **numbers,
        )


NUMBERS = tuple(  # the fields that are one number each, here and in the core
    name for name, kind in EvaluationFile.__annotations__.items() if kind == "Number"
)
