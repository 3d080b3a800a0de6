"""`orthoscope calibrate`: photographs, or corners found before, to a camera with its report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from orthoscope.cli.shared import options
from orthoscope.cli.shared.printing import tell, tell_json, tell_of_earlier, tell_remarks

__all__ = ["calibrate", "calibrate_into"]

# What is written into the folder where it is asked for.
ON_REQUEST = ("report.html", "camera-*", "corrected.*")

EXAMPLE = """\b
Example:
  $ orthoscope calibrate photos/ --target chessboard:9x6:25mm -o camera/
  verdict    Good within a region: off by about 0.2 px where corners were seen, and by less than 0.5 px over
             67 % of the frame. Too few corners were seen at the top left. Next, photograph the target at the
             top left.
  camera     fx 534.83 ± 0.78  fy 535.07 ± 0.85  cx 342.10 ± 0.99  cy 239.69 ± 0.88  lens free on brown
  photos     14 used, 756 corners; corners missed by 0.084 px where a photograph was not used
  wrote      camera/detections.json, camera/calibration.json, camera/evaluation.json, camera/report.html

\b
PHOTOS are files, folders and globs; or one detections.json, corners.vnl or corners.csv.
Exit: 0 done, 1 the photographs cannot tell the camera, 2 the command is wrong,
3 with --strict: the camera must not be used.
"""


@click.command(epilog=EXAMPLE)
@options.photos
@options.target
@options.topic
@options.lens
@options.method
@options.shape
@options.base
@options.fit
@options.skew
@options.loss
@options.image_size
@options.own_folds
@click.option(
    "--without",
    multiple=True,
    metavar="NAME",
    help="Leave this photograph out, once for each; detections.json keeps it.",
)
@click.option(
    "--set",
    "more",
    multiple=True,
    metavar="NAME=VALUE",
    help="Any other setting of the method, once for each: --method mldc --set correct=literal --set weights=1,1,1e4.",
)
@options.jobs
@options.cluster
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("camera"),
    show_default=True,
    help="Folder to write.",
)
@click.option(
    "--export",
    multiple=True,
    type=options.TOOL,
    help=(
        "Also write the camera for a tool (`orthoscope tools` lists them), into OUT/camera-TOOL; once for each"
        " tool. --lens auto then takes a lens that the first of them has."
    ),
)
@click.option("--undistort", is_flag=True, help="Also write straight pictures, into OUT/undistorted.")
@options.keep
@click.option(
    "--corrected",
    is_flag=True,
    help=(
        "Also write the corrected points, where the pin-hole alone sees the corners: beside the detected ones in"
        " OUT/corrected.csv, as detections in OUT/corrected.json."
    ),
)
@click.option("--report/--no-report", default=True, help="Whether to write OUT/report.html.")
@options.strict
@options.verbose
@options.as_json
def calibrate(photos: tuple[str, ...], **settings: Any) -> None:
    """Calibrate a camera from photographs of a flat target."""
    calibrate_into(photos, **settings)


def calibrate_into(
    photos: tuple[str, ...],
    *,
    target: str | None,
    out: Path,
    topic: str | None = None,
    lens: str = "auto",
    method: str = "decoupled",
    shape: str | None = None,
    base: str | None = None,
    fit: str | None = None,
    skew: bool = False,
    loss: str | None = None,
    image_size: tuple[int, int] | None = None,
    folds: int | None = None,
    without: tuple[str, ...] = (),
    more: tuple[str, ...] = (),
    jobs: int | None = None,
    cluster: str | None = None,
    export: tuple[str, ...] = (),
    undistort: bool = False,
    keep: str = "all",
    corrected: bool = False,
    report: bool = True,
    strict: bool = False,
    verbose: bool = False,
    as_json: bool = False,
) -> Any:
    """The main job; prints the summary and returns the evaluation."""
    from orthoscope.cli.shared.progress import bar

    with bar("starting"):  # loading takes most of the first half second
        from orthoscope.cli.shared.executors import processes, threads
        from orthoscope.cli.shared.exit_codes import leave_unless_usable
        from orthoscope.cli.shared.inputs import detections_from
        from orthoscope.cli.shared.judged_calibration import EVALUATION_NAME
        from orthoscope.cli.shared.method_settings import settings_from
        from orthoscope.cli.shared.summary import evaluation_lines
        from orthoscope.evaluation.evaluate import evaluate
        from orthoscope.files.whole_files import check_folder
        from orthoscope.formats.own.json import save, text_of
        from orthoscope.methods import calibrate as run
        from orthoscope.methods import settings_of
        from orthoscope.targets.left_out import left_out

    check_folder(out)
    lenses = _lenses_of(export[0]) if export else ()
    formulas = lenses if "formulas" in settings_of(method) else ()
    given = {
        "lens": lens,
        "skew": skew,
        "shape": shape,
        "base": base,
        "fit": fit,
        "loss": loss,
        "formulas": formulas or None,
    }
    given = {name: value for name, value in given.items() if value is not None} | settings_from(more)
    with threads(jobs, cluster) as executor, bar("detecting") as progress:
        detections, files = detections_from(
            photos, target, image_size=image_size, executor=executor, progress=progress, topic=topic
        )
    tell_remarks(detections)
    save(detections, out / "detections.json")
    written = [out / "detections.json"]
    detections = left_out(detections, without) if without else detections
    with bar("calibrating") as progress:
        told = {"judging": progress} if "judging" in settings_of(method) else {}
        calibration = run(detections, method=method, **given, **told)
    with processes(jobs if folds else jobs or 1, cluster) as executor, bar("evaluating") as progress:
        evaluation = evaluate(calibration, folds=folds, executor=executor, progress=progress)
    for thing, name in ((calibration, "calibration.json"), (evaluation, EVALUATION_NAME)):
        save(thing, out / name)
        written.append(out / name)
    if corrected:
        written += _write_corrected(calibration, out)
    if export:
        written += [path for tool in dict.fromkeys(export) for path in _write_for(tool, calibration, out)]
    if report:
        written.append(_write_report(evaluation, files, out, keep=keep, jobs=jobs))
    if undistort:
        written.append(_write_straight(evaluation, files, out, keep=keep, jobs=jobs, cluster=cluster))
    if as_json:
        tell_json(text_of(evaluation))
    else:
        tell(*evaluation_lines(evaluation, verbose=verbose), "wrote      " + ", ".join(map(str, written)))
    _tell_of_others(out, written)
    leave_unless_usable(evaluation.verdict.grade, strict=strict)
    return evaluation


def _tell_of_others(out: Path, written: list[Path]) -> None:
    """Say what earlier calibrations wrote into the folder that this one did not write anew."""
    there = [path for pattern in ON_REQUEST for path in sorted(out.glob(pattern)) if path.is_file()]
    tell_of_earlier([path for path in there if path not in written])


def _write_corrected(calibration: Any, out: Path) -> list[Path]:
    """Write the corrected points, as a table and as detections."""
    from orthoscope.files.whole_files import write_text
    from orthoscope.formats.corrected import corrected_csv
    from orthoscope.formats.own.json import save

    write_text(out / "corrected.csv", corrected_csv(calibration))
    save(calibration.corrected(), out / "corrected.json")
    return [out / "corrected.csv", out / "corrected.json"]


def _lenses_of(tool: str) -> tuple[str, ...]:
    """The lenses that a tool has."""
    from orthoscope.formats.table import tool as record

    return record(tool).lenses


def _write_for(tool: str, calibration: Any, out: Path) -> list[Path]:
    """Write the camera for a tool, and say what that costs."""
    from orthoscope.formats.export import export
    from orthoscope.formats.table import FORMATS

    exported = export(calibration, out / f"camera-{tool}{FORMATS[tool].suffixes[0]}", tool, anyway=True)
    for remark in exported.remarks():
        tell(f"{tool:<10} {remark}", err=True)
    return list(exported.files)


def _write_report(evaluation: Any, files: dict[str, Path], out: Path, *, keep: str, jobs: int | None) -> Path:
    from orthoscope.cli.shared.executors import threads
    from orthoscope.cli.shared.progress import bar
    from orthoscope.report.page import write_report
    from orthoscope.report.pictures import pictures_of

    with threads(jobs) as executor, bar("report") as progress:
        pictures = pictures_of(evaluation.calibration, files, keep=keep, executor=executor, progress=progress)
    write_report(evaluation, out / "report.html", pictures=pictures)
    return out / "report.html"


def _write_straight(
    evaluation: Any, files: dict[str, Path], out: Path, *, keep: str, jobs: int | None, cluster: str | None
) -> Path:
    from orthoscope.cli.undistort import straighten, straighten_films, write_beside
    from orthoscope.files.pictures import MOVING
    from orthoscope.geometry.arrays import InputError
    from orthoscope.straight.film import is_video
    from orthoscope.straight.outputs import of_earlier_runs
    from orthoscope.straight.views import straight_camera

    if not files:
        raise InputError(
            "--undistort needs the photographs; these were corners found before. Use `orthoscope undistort`"
            " with the photographs."
        )
    calibration, folder = evaluation.calibration, out / "undistorted"
    paths = list(dict.fromkeys(_file_of(view.image, files) for view in calibration.detections.views))
    films = [path for path in paths if is_video(path)]
    photographs = [path for path in paths if path.suffix.lower() not in MOVING]
    view = straight_camera(calibration.camera, keep=keep)
    written = list(straighten_films(films, calibration.camera, folder, view=view, jobs=jobs))
    if photographs:
        written += straighten(photographs, calibration.camera, folder, view=view, jobs=jobs, cluster=cluster)[
            0
        ]
    beside = write_beside(calibration.camera, view, folder, maps=None)
    tell_of_earlier(of_earlier_runs(folder, [*written, *beside]))
    if others := len(paths) - len(films) - len(photographs):
        tell(f"left out   {others} files of frames that cannot be written straight; convert them", err=True)
    return folder


def _file_of(image: str, files: dict[str, Path]) -> Path:
    """The file that a view was found in: a photograph, or a file of pages or frames."""
    from orthoscope.files.pictures import file_name_of
    from orthoscope.targets.detections import photograph_of

    photograph = photograph_of(image)
    return files[photograph] if photograph in files else files[file_name_of(photograph)]
