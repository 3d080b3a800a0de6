"""What `comparison.json` holds: the detections that all met, and of each entry the camera it came to and how
far it was off.

Calibrations themselves are not kept: `calibrate` with the entry's settings makes the same again.
"""

from __future__ import annotations

from typing import Any

from orthoscope.evaluation.comparison.compare import Comparison, Standing
from orthoscope.evaluation.comparison.entry import AS_IT_IS, Entry
from orthoscope.formats.own.schema import CameraFile, DetectionsFile, TargetShapeFile
from orthoscope.formats.own.struct import FileStruct, Number, array_of, null_for_nan, rows_of
from orthoscope.geometry.arrays import InputError
from orthoscope.version import __version__

__all__ = ["ComparisonFile"]


class StandingFile(FileStruct, kw_only=True):
    name: str
    method: str
    settings: dict[str, Any]
    held_out_px: Number
    error_px: Number
    loses_px: Number
    loses_error_px: Number
    nce: Number
    rms_px: Number
    parameters: Number
    seconds: Number
    failure: str = ""
    lens: str = ""
    squares: list[Number]
    camera: CameraFile | None = None
    target_shape: TargetShapeFile | None = None

    @classmethod
    def of(cls, standing: Standing) -> StandingFile:
        shape = standing.target_shape
        return cls(
            name=standing.entry.name,
            method=standing.entry.method,
            settings=dict(standing.entry.settings),
            failure=standing.failure,
            lens=standing.lens,
            squares=rows_of(standing.squares),
            camera=CameraFile.of(standing.camera) if standing.camera else None,
            target_shape=TargetShapeFile.of(shape) if shape else None,
            **{name: null_for_nan(getattr(standing, name)) for name in NUMBER_FIELDS},
        )

    def core(self) -> Standing:
        numbers = {name: getattr(self, name) for name in NUMBER_FIELDS}
        camera = self.camera and self.camera.core()
        given = camera if self.method == AS_IT_IS else None
        return Standing(
            Entry(self.name, self.method, self.settings, given),
            array_of(self.squares, -1),
            camera=camera,
            target_shape=self.target_shape and self.target_shape.core(),
            lens=self.lens,
            failure=self.failure,
            **{name: float("nan") if value is None else value for name, value in numbers.items()},
        )


class ComparisonFile(FileStruct, kw_only=True):
    version: str
    conclusions: list[str]
    folds: int
    standings: list[StandingFile]
    detections: DetectionsFile

    @classmethod
    def of(cls, comparison: Comparison) -> ComparisonFile:
        from orthoscope.evaluation.comparison.conclusions import conclusions

        return cls(
            version=__version__,
            conclusions=list(conclusions(comparison)),
            folds=comparison.folds,
            standings=[StandingFile.of(standing) for standing in comparison.standings],
            detections=DetectionsFile.of(comparison.detections),
        )

    def core(self) -> Comparison:
        standings = tuple(standing.core() for standing in self.standings)
        if any(len(standing.squares) != len(self.detections.views) for standing in standings):
            raise InputError(f"an entry has not {len(self.detections.views)} squares, one for each view")
        return Comparison(self.detections.core(), self.folds, standings)


# These fields are one number each.
NUMBER_FIELDS = tuple(name for name, kind in StandingFile.__annotations__.items() if kind == "Number")
