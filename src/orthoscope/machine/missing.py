"""Packages that orthoscope needs for a part of its work and does not install by itself, and how one gets
them.

OpenCV is one package in four flavours that overwrite each other: installing one beside another that is there
already breaks it. So none is a dependency; whichever is there is used.
"""

from __future__ import annotations

__all__ = ["how_to_install"]

# What is imported, and what to say where it is not there.
SEPARATE = {
    "cv2": "OpenCV is not installed; expected any flavour of it (opencv-python, opencv-contrib-python or"
    " either"
    " -headless). Install one: pip install 'orthoscope[opencv]', or [opencv-contrib].",
    "av": "PyAV is not installed; films with sound need it. Install it: pip install 'orthoscope[video]'.",
    "pillow_heif": "pillow-heif is not installed; HEIC photographs need it. Install it: pip install"
    " 'orthoscope[heic]'.",
    "rawpy": "rawpy is not installed; raw photographs need it. Install it: pip install 'orthoscope[raw]'.",
    "rosbags": "rosbags is not installed; ROS bags need it. Install it: pip install 'orthoscope[ros]'.",
    "distributed": "Dask is not installed; --cluster needs it. Install it: pip install"
    " 'orthoscope[cluster]'.",
}


def how_to_install(error: ModuleNotFoundError) -> str | None:
    """What to say where a package of SEPARATE could not be imported; None for any other."""
    return SEPARATE.get((error.name or "").partition(".")[0])
